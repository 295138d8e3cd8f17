"""Publication of a finished dataset: its table of frames, pictures, card and Croissant description in its folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rso_lidar.dataset.publication.attribution import CROISSANT, Attribution, read_attribution
from rso_lidar.dataset.publication.card_tables import count_frames
from rso_lidar.dataset.publication.card_text import CARD
from rso_lidar.dataset.publication.contest_folder import write_contest
from rso_lidar.dataset.publication.croissant import write_croissant
from rso_lidar.dataset.publication.dataset_card import write_card
from rso_lidar.dataset.publication.frame_index import INDEX, has_parquet, write_frame_index
from rso_lidar.dataset.publication.label_images import label_figure
from rso_lidar.dataset.reading.random_access import Dataset
from rso_lidar.dataset.shards.layout import name_camera_array
from rso_lidar.errors import DatasetError
from rso_lidar.picture import save_figure

PICTURES = ("sample_frame_1.png", "sample_frame_2.png")
_MOST_FRAMES = 256  # frames of the first split among which those of the pictures are chosen: one shard by default
_DRAWN_OF_CAMERA = ("intensity_counts", "part_class_id", "range_m", "filled_fraction")
_DRAWN = ("range_m", "intensity_counts", "part_class_id", "detection_probability", "photons")


def publish(
    folder: Path,
    *,
    licence: str | None = None,
    creators: tuple[str, ...] = (),
    url: str | None = None,
    hidden_labels: Path | None = None,
    overwrite: bool = False,
) -> list[str]:
    """Write the card, the Croissant description, the table of frames and some pictures into the folder of a dataset.

    A licence, creators or address that are not given stay as an earlier publication stated them. With `hidden_labels`, write
    the folder of a contest instead: the dataset with a test split that has no labels.

    Parameters
    ----------
    folder : of a complete dataset
    licence : SPDX identifier, such as ``CC-BY-4.0``
    creators : names of persons or groups
    url : web address of the dataset
    hidden_labels : new folder of a contest, to give away. The labels stay in `folder`, with a key that `score` needs
    overwrite : whether an earlier folder of a contest may be replaced

    Returns
    -------
    list of str
        Lines for the user: the files that were written, and notes on a missing library or licence.

    Raises
    ------
    DatasetError
        If the folder is no dataset or holds no frames, a shard is damaged, or an argument is not valid. For a contest, also
        if its labels follow from what is published.
    RunError
        If writing fails.
    """
    data = Dataset(folder)
    if not data.splits:
        raise DatasetError(f"{folder}: holds no frames yet; make them with --resume")
    if data.labelled_splits != data.splits:
        raise DatasetError(
            f"{folder}: is a contest, whose card was written with it; publish the dataset with the labels"
        )
    stated = read_attribution(folder)
    attribution = Attribution(licence or stated.licence, creators or stated.creators, url or stated.url)
    if hidden_labels is not None:
        return write_contest(data, hidden_labels, attribution, overwrite=overwrite)
    lines, written = [], [CARD, CROISSANT]
    if has_parquet():
        written.append(write_frame_index(data).name)
    else:
        (folder / INDEX).unlink(missing_ok=True)  # of an earlier run: it would not describe these frames
        lines.append(f"{INDEX} left out: it needs an extra, pip install rso-lidar[parquet]")
    pictures = _draw_pictures(data)
    write_card(data, count_frames(data), pictures, attribution)
    write_croissant(data, attribution)
    lines.insert(0, f"written     {', '.join([*written, *pictures])} in {folder}")
    if attribution.licence is None:
        lines.append(f"{CARD} and {CROISSANT} state no licence: rso-lidar dataset publish {folder} --licence CC-BY-4.0")
    return lines


def _draw_pictures(data: Dataset) -> list[str]:
    """Draw the frames of the first shard with most and with the median of reporting pixels; return names of the pictures.

    Of each camera beside the lidar, its image of the last of these frames is drawn.
    """
    split = data.split(data.splits[0])
    rows = range(min(_MOST_FRAMES, len(split)))
    reporting = split.read(rows, ["reporting_pixels"])["reporting_pixels"]
    order = np.argsort(reporting, kind="stable")[::-1]
    reporting_rows = order[: max(1, int((reporting > 0).sum()))]
    chosen = dict.fromkeys((int(reporting_rows[0]), int(reporting_rows[len(reporting_rows) // 2])))
    names = []
    for name, row in zip(PICTURES, chosen, strict=False):
        frame = split[row]
        number = int(frame["class_id"])
        what = f"{data.classes[number]} at {float(frame['range_to_target_m']):,.1f} m" if number >= 0 else "no target"
        note = f"sample {int(frame['sample'])} of {split.name}: {what}"
        images = {image: frame[image] for image in _DRAWN if image in frame}
        save_figure(label_figure(images, data.part_classes, data.spec.name, note), data.folder / name)
        names.append(name)
    for camera in data.cameras:
        arrays = {field: frame[name_camera_array(camera, field)] for field in _DRAWN_OF_CAMERA}
        images = {"image": arrays["intensity_counts"], "part_class_id": arrays["part_class_id"]}
        images |= {"true_range_m": arrays["range_m"], "filled_fraction": arrays["filled_fraction"]}
        names.append(f"sample_camera_{camera}.png")
        figure = label_figure(images, data.part_classes, data.spec.name, f"camera {camera}, {note}")
        save_figure(figure, data.folder / names[-1])
    return names
