"""The description of a dataset in the Croissant format of MLCommons, version 1.1, with its vocabulary of responsible AI.

Croissant cannot describe what is inside HDF5 files (mlcommons/croissant#697). Its records are therefore the rows of the
table of frames, and the shards are files with hashes. https://docs.mlcommons.org/croissant/docs/croissant-spec-1.1.html
"""

from __future__ import annotations

import datetime
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rso_lidar.dataset.publication.attribution import CROISSANT, SPDX, Attribution
from rso_lidar.dataset.publication.card_text import cite, describe_dataset, list_limits
from rso_lidar.dataset.publication.frame_index import INDEX, NAMES, list_index_columns
from rso_lidar.dataset.shards.manifest import MANIFEST
from rso_lidar.dataset.shards.sensor_file import SENSOR_FILE
from rso_lidar.dataset.shards.shard_file import hash_file
from rso_lidar.files import write_text

if TYPE_CHECKING:
    from rso_lidar.dataset.reading.random_access import Dataset
    from rso_lidar.records import ArraySpec

MOST_FILES = 4000  # shards listed one by one, about a million frames; of more shards, only the manifest has the hashes
HDF5, PARQUET = "application/x-hdf5", "application/x-parquet"  # media types as mlcroissant knows them
FILES = {  # of every dataset: what each holds, and its media type
    "dataset.toml": ("specification that made the dataset", "application/toml"),
    "scenario.toml": ("base scenario of the simulation", "application/toml"),
    MANIFEST: (
        "path, frames, bytes, SHA-256 and versions of each shard, one JSON object per line",
        "application/jsonl",
    ),
    SENSOR_FILE: ("names of classes, models, sensors, cameras and parts, lines of sight and symmetries", HDF5),
    INDEX: ("one row per frame: all of its numbers, its split, and its place in the shards", PARQUET),
}
_KINDS = {"i": "cr:Int64", "u": "cr:Int64", "f": "cr:Float64"}


def write_croissant(data: Dataset, attribution: Attribution) -> Path:
    """Write ``croissant.json`` into the folder of a dataset, and return its path.

    Parameters
    ----------
    data : the dataset, with its table of frames already in the folder if there is to be one
    """
    text = json.dumps(describe_in_croissant(data, attribution), indent=1, ensure_ascii=False) + "\n"
    return write_text(data.folder / CROISSANT, text, overwrite=True)


def describe_in_croissant(data: Dataset, attribution: Attribution) -> dict[str, Any]:
    """Describe a dataset as JSON-LD."""
    published = (
        datetime.datetime.fromtimestamp((data.folder / MANIFEST).stat().st_mtime, datetime.UTC).date().isoformat()
    )
    description: dict[str, Any] = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": ["http://mlcommons.org/croissant/1.1", "http://mlcommons.org/croissant/RAI/1.0"],
        "name": data.spec.name,
        "description": describe_dataset(data),
        "version": f"1.0.0+{data.constants.sha256[:12]}",
        "datePublished": published,
        "inLanguage": "en",
        "keywords": ["flash lidar", "range image", "spacecraft", "pose estimation", "simulation", *_name_images(data)],
        "citeAs": cite(data, attribution),
        "rai:dataCollection": "Computed by the simulator rso_lidar from dataset.toml; no measurement of a real sensor.",
        "rai:dataCollectionType": ["Software Collection"],
        "rai:dataAnnotationProtocol": [
            "All labels are computed with the frame from the simulated geometry and light; no person annotates."
        ],
        "rai:machineAnnotationTools": ["rso_lidar, in the versions that manifest.jsonl states"],
        "rai:dataLimitations": list(list_limits(data)),
        "rai:dataUseCases": [
            "Training and regression tests of classification, detection, segmentation and pose estimation of spacecraft."
        ],
        "rai:personalSensitiveInformation": ["None: the subjects are spacecraft and test bodies."],
        "distribution": [*_list_files(data), *_list_shards(data)],
        "recordSet": _list_record_sets(data),
    }
    if attribution.licence is not None:
        description["license"] = f"{SPDX}{attribution.licence}.html"
    if attribution.creators:
        description["creator"] = [{"@type": "sc:Person", "name": name} for name in attribution.creators]
    if attribution.url is not None:
        description["url"] = attribution.url
    return description


def _name_images(data: Dataset) -> list[str]:
    """Return the keyword of images of cameras, if there are any."""
    return ["camera image"] if data.cameras else []


def _list_files(data: Dataset) -> Iterable[dict[str, Any]]:
    """Yield the existing files beside the shards."""
    for name, (meaning, media_type) in FILES.items():
        place = data.folder / name
        if place.is_file():
            yield _describe_file(name, meaning, media_type, place.stat().st_size, hash_file(place))


def _describe_file(path: str, meaning: str, media_type: str, size_bytes: int, sha256: str) -> dict[str, Any]:
    """Describe a file."""
    return {
        "@type": "cr:FileObject",
        "@id": path,
        "name": path,
        "description": meaning,
        "contentUrl": path,
        "contentSize": f"{size_bytes} B",
        "encodingFormat": media_type,
        "sha256": sha256,
    }


def _list_shards(data: Dataset) -> Iterable[dict[str, Any]]:
    """Yield a set of files for each split, and up to `MOST_FILES` shards with their hashes."""
    for split in data.splits:
        yield {
            "@type": "cr:FileSet",
            "@id": f"{split}-shards",
            "name": f"{split}-shards",
            "description": f"Shards of the split {split}: HDF5 files in which every array has the frame as first axis.",
            "encodingFormat": HDF5,
            "includes": f"{split}/*.h5",
        }
    if len(data.records) <= MOST_FILES:
        for record in data.records:
            meaning = f"{record.frames} frames of {record.samples} samples"
            yield _describe_file(record.path, meaning, HDF5, record.size_bytes, record.sha256)


def _list_record_sets(data: Dataset) -> list[dict[str, Any]]:
    """List the record sets: names of splits, classes, models and part classes, and the table of frames if it exists."""
    sets = [
        _list_names("splits", "Splits of the dataset.", data.splits, "cr:Split"),
        _list_names("classes", "Classes, in the order of class_id from 0; -1 is no target.", data.classes),
        _list_names("models", "Models, in the order of model_id from 0; -1 is no target.", data.models),
        _list_names(
            "part_classes", "Common part classes, in the order of part_class_id from 0; -1 is sky.", data.part_classes
        ),
    ]
    if not (data.folder / INDEX).is_file():
        return sets
    fields = [
        _describe_field(name, meaning, "cr:Int64" if name == "row" else "sc:Text") for name, meaning in NAMES.items()
    ]
    for name, spec in list_index_columns(data).items():
        field = _describe_field(name, _explain(spec), _KINDS[spec.dtype.kind])
        fields.append(field | ({"isArray": True, "arrayShape": str(_count(data, name))} if spec.dims else {}))
    frames = {
        "@type": "cr:RecordSet",
        "@id": "frames",
        "name": "frames",
        "description": "One record per frame; its images are in the file `shard` at the index `row`.",
        "key": [{"@id": f"frames/{name}"} for name in ("sample", "step", "draw")],
        "field": fields,
    }
    return [*sets, frames]


def _list_names(name: str, meaning: str, entries: Sequence[str], data_type: str = "sc:Enumeration") -> dict[str, Any]:
    """Describe a list of names."""
    field = {"@type": "cr:Field", "@id": f"{name}/name", "name": "name", "dataType": "sc:Text"}
    return {
        "@type": "cr:RecordSet",
        "@id": name,
        "name": name,
        "description": meaning,
        "dataType": data_type,
        "key": {"@id": f"{name}/name"},
        "field": [field],
        "data": [{f"{name}/name": entry} for entry in entries],
    }


def _describe_field(name: str, meaning: str, data_type: str) -> dict[str, Any]:
    """Describe a column of the table of frames."""
    source = {"fileObject": {"@id": INDEX}, "extract": {"column": name}}
    return {
        "@type": "cr:Field",
        "@id": f"frames/{name}",
        "name": name,
        "description": meaning,
        "dataType": data_type,
        "source": source,
    }


def _explain(spec: ArraySpec) -> str:
    """Return the meaning of an array with its unit."""
    return spec.meaning if spec.unit == "1" else f"{spec.meaning} [{spec.unit}]"


def _count(data: Dataset, name: str) -> int:
    """Return the number of components of a short vector."""
    return int(data.split(data.splits[0]).read([0], [name])[name].shape[1])


_CONTEXT = {  # as the specification prints it
    "@language": "en",
    "@vocab": "https://schema.org/",
    "arrayShape": "cr:arrayShape",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "containedIn": "cr:containedIn",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "description": {"@container": "@language"},
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileProperty": "cr:fileProperty",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isArray": "cr:isArray",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "name": {"@container": "@language"},
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
