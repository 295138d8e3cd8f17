"""Functions that others call state each parameter, and what they return, in sections of numpy style.

What the package or a room exports (functions, and the public methods of classes) has *Parameters*, and *Returns* unless
its first line starts with *Return*. Any other function or method with three parameters or more has *Parameters*; its first
line names what it computes. A method is documented in its own docstring, in that of the same method of a base class, or in
a `Protocol` of this package that its class implements with the same names of parameters. A command of the command line
states its parameters in the `help` of its options, from which ``--help`` is made.
"""

import importlib
import inspect
import pkgutil
import re
import typing

import rso_lidar

MANY = 3  # parameters: from here on, a function that nobody exports is documented too
SECTION = re.compile(r"^(?P<title>[A-Z][A-Za-z ]+)\n-{3,}$", re.MULTILINE)
NAMES = re.compile(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: :|$)", re.MULTILINE)

NOT_YET = {  # functions that are documented next, by room
    "cli": """
        _show_warning catalog._check_known catalog._summarise export._summarise models_add._check_word
        progress._Lines.__init__ run._is_complete
    """,
    "detector": """
        analysis.full_chain._wait bench.prediction.predict bench.range_resolution._simulate_listed
        chain.analog.draw_speckle_factors chain.curves._draw_first_false_s chain.curves._quantise chain.full._store
        chain.measurement._draw_normal chain.timing._shape_pulse detect._call detect.advise detect.array_load
        detect.describe detect.describe_storage detect.describe_window detect.detect_with_taps
        detect.detection_probability detect.draw_crosstalk_m detect.false_alarm_probability detect.frame_jitter_s
        detect.isolate detect.list_neglected_effects geiger.array.GeigerArray.false_peak_probability
        geiger.array.GeigerArray.find_least_counts geiger.array.GeigerArray.noise_per_s
        ranging.gate_threshold._solve_threshold ranging.matched_filter.Matched.__init__
        ranging.matched_filter._make_filter ranging.pulse.crlb_s settings.amplifier.Amplifier.correlation
        settings.amplifier.Amplifier.response settings.empirical.Empirical.counts
        settings.empirical.Empirical.detection_probability settings.empirical.Empirical.noise_photons
        settings.empirical.Empirical.range_noise_m settings.gate.Gate.n_samples settings.gsfl.Gsfl.alone
        settings.gsfl.Gsfl.counts settings.gsfl.Gsfl.noise_in_light settings.gsfl.Gsfl.replace
        settings.gsfl.Gsfl.with_gate_delay stages.amplification.Filters.__init__ stages.comparator.Bridge.__init__
        stages.comparator.find_crossings_between stages.crossing_rate._pulses stages.false_triggers._rates
        stages.false_triggers.draw_crossings stages.false_triggers.draw_first_crossings stages.overlap.copy_shared
        stages.row_noise.fill_words stages.time_axis.find_rows
    """,
    "errors": """
        PropagationError.__init__
    """,
    "export": """
        formats.bop._describe_camera formats.bop._describe_objects formats.bop._write_camera
        formats.bop._write_entry formats.bop._write_images formats.czml._check_document formats.czml._line
        formats.czml._orientation formats.czml._position formats.czml._samples formats.frame_files.write_new_file
        formats.frame_files.write_source formats.mcap._check_file formats.mcap._image formats.mcap._messages
        formats.mcap._stamp formats.npz._check_archive formats.npz._describe_arrays
        formats.trajectory._compute_poses formats.trajectory._open_text formats.trajectory._resolve_axes
        layout.intermediates.check_kept open reader.recording.Frames.__init__ reader.recording.Recording.__init__
        reader.recording.Recording.dataset reader.recording_file.RecordingFile.__init__
        reader.recording_file.RecordingFile.handle reader.recording_file.RecordingFile.place
        reader.recording_file.RecordingFile.read reader.recording_file.RecordingFile.watched
        reader.recording_file._extract_between reader.status._read_file_status
        reader.stored_array.StoredArray.__init__ reader.zarr_file._check_chunks registry.format_for
        registry.writer_for save writer.chunks.ChunkWriter._append writer.deflate._end_run
        writer.hdf5_layout._attach_scales writer.hdf5_layout._lay_out_line_of_sight writer.hdf5_layout._make_dataset
        writer.hdf5_layout._make_own_scales writer.hdf5_layout._make_scale writer.recorder.Recorder._has_other_lens
        writer.recorder.Recorder.write writer.recorder.check_output writer.temporary_file.InterferenceError.__init__
        writer.zarr_store.ZarrWriter.__init__ writer.zarr_store.ZarrWriter._create
    """,
    "files": """
        _too_large read_bytes read_text write_text
    """,
    "optics": """
        laser.Laser.density laser.Laser.is_lit laser._measured_taps laser._measured_width_s
        lens.distortion.DistortionPart.area lens.distortion.DistortionPart.area_at_direction
        lens.distortion.DistortionPart.check lens.distortion.DistortionPart.distort
        lens.distortion.DistortionPart.undistort lens.distortion.ZemaxDistortion.check
        lens.distortion.ZemaxDistortion.residual_pixels lens.distortion._fit lens.psf.AiryPsf.core
        lens.psf.GaussianPsf.core lens.psf.GridPsf.core lens.psf.PsfPart.core lens.psf.PsfPart.hats
        lens.psf.ZemaxPsf.core lens.psf._shares receiver.Receiver.image_of receiver.Receiver.tangents_at
        returns.blur.read_files tables.laser_profiles._pattern tables.laser_profiles._pulse tables.zemax._grid
        tables.zemax._huygens
    """,
    "orbit": """
        ccsds.ephemeris.Ephemeris.breaks_s ccsds.ephemeris.Ephemeris.span_utc ccsds.ephemeris.Ephemeris.validity
        ccsds.ephemeris._read ccsds.ephemeris._read_segment epochs.Epochs.shift epochs.Epochs.since
        propagation.integrator._Direction.__init__ propagation.j2.J2.validity propagation.numerical.Numerical.advise
        propagation.numerical.Numerical.breaks_s propagation.numerical.Numerical.summarize
        propagation.numerical._set_entry sets.catalog.Catalog._of sets.catalog.Catalog.from_file
        sets.catalog.Catalog.from_text sets.catalog.Catalog.trajectory sets.catalog.Catalog.write
        sets.formats._object sets.formats._read sets.omm_text._make_broken sets.set_sequence.SetSequence.ages_days
        sets.set_sequence.SetSequence.breaks_s sets.set_sequence.SetSequence.jumps
        sets.set_sequence.SetSequence.which sets.sgp4_motion.Omm.epoch_age_days sets.sgp4_motion.Omm.of
        sets.sgp4_motion.Omm.summarize sets.sgp4_motion.Tle.breaks_s sets.sgp4_motion.Tle.check
        sets.sgp4_motion.Tle.elements sets.sgp4_motion.Tle.epoch_age_days sets.sgp4_motion.Tle.inline
        sets.sgp4_motion.Tle.jumps sets.sgp4_motion.Tle.summarize sets.sgp4_motion.Tle.trajectory
        sets.sgp4_motion._summarize two_body.kepler.Kepler.state_rates two_body.kepler.State.state_rates
        two_body.kepler._propagate_one two_body.lambert._Geometry.from_positions
    """,
    "part": """
        Part.replace Seam._serialize _place explain
    """,
    "philox": """
        _block _turn
    """,
    "picture": """
        frames.animation._write_gif frames.animation._write_mp4 frames.frame._draw_bar frames.frame._draw_error
        frames.frame._draw_parts frames.frame._write_heading frames.frame.frame_figure frames.frame.save_frame
        frames.raster._draw_bar plots.angles._choose_target plots.angles.angles_figure plots.angles.ptu_figure
        plots.budget._mark plots.budget._prepare_axes plots.curves.curve_figure plots.encounters.encounter_figure
        plots.model_card._names plots.model_card._shade plots.orbit.inertial_figure plots.timeline._draw_angles
        plots.timeline._draw_drive plots.timeline._draw_field plots.timeline.timeline_figure
        plots.tracking._draw_errors plots.tracking._draw_nis plots.tracking._draw_on_log
        plots.tracking.tracking_figure plots.trade._draw_effect plots.trajectory._choose_target
        plots.trajectory.orbit_figure selection.sequence.even_indices viewers.rerun_scene._Scene.__init__
    """,
    "pose": """
        Link.__init__
    """,
    "records": """
        schema.array schema.specs truth.Truth.at truth.Truth.pose truth.Truth.rates
    """,
    "rpo": """
        plans.approach.CoElliptic.make_plan plans.approach.StationKeeping.make_plan
        plans.approach._AlongAnAxis._plan_hops plans.approach._AlongAnAxis.make_plan
        plans.circumnavigation.Circumnavigation.make_plan plans.circumnavigation.ForcedCircumnavigation.make_plan
        plans.circumnavigation.SafetyEllipse.make_plan plans.circumnavigation.Teardrop.loop_s
        plans.circumnavigation.Teardrop.make_plan plans.operation.ProximityOperation.breaks_s
        plans.operation.ProximityOperation.describe_flattening plans.operation.ProximityOperation.make_plan
        plans.operation._keep_out_error plans.plan.Plan._find_nearest_adrift plans.plan.Plan.control_m_s2
        plans.plan.Plan.free_s plans.plan.Plan.passive_safety_m plans.plan.Plan.relative
        plans.transfers.Hop.make_plan plans.transfers.Lambert.make_plan plans.transfers.Rendezvous.make_plan
        plans.transfers.Waypoints.make_plan relative.nonlinear.Nonlinear._rates
        relative.relative_motion.RelativeMotion.breaks_s
    """,
    "scenario": """
        assessment.compliance._check_corridor assessment.compliance._check_exclusions
        assessment.compliance._check_keep_out assessment.description._describe_motion
        assessment.description._describe_target assessment.description._format_ends
        assessment.environment._advise_on_line_of_sight assessment.environment._advise_on_sun
        assessment.environment._describe_passage assessment.environment._format_course
        mission.mission.Mission.corners_of mission.mission.Mission.epochs mission.mission.Mission.file
        mission.mission.Mission.locate_errors mission.mission.Mission.replace mission.mission.Mission.rng
        mission.mission.Mission.surfaces_of mission.validation._descend_to scenario.require_scenario
        tables.constraints.Constraints.radius_m tables.constraints.Corridor.angle_rad
        tables.constraints.Corridor.applies tables.constraints.Corridor.margin_m
        tables.facet_materials._find_material tables.lidar.Lidar.at tables.lidar.Lidar.replace
        tables.lidar.Lidar.with_settings tables.schedule.Schedule.at tables.world.Time.seconds
    """,
    "scene": """
        casting.cast._average_over_lens casting.cast._relight casting.extent.extent casting.extent.sort_points
        casting.first_hits.bound_rays casting.first_hits.may_touch casting.first_hits.place_targets
        embree.ray_by_ray._find_any embree.ray_by_ray._find_first labels.label library.model_index._entry
        library.model_index.model materials.choice.ByWavelength.at materials.choice.Named.at
        materials.choice.find_material materials.crinkle.Crinkled.mean_brdf_per_sr
        materials.crinkle.Crinkled.tilt_normals materials.diffraction._mean materials.retro.RetroReflector._around
        materials.retro.RetroReflector.at materials.retro.RetroReflector.sunlight_brdf_per_sr
        materials.scatterer.Scatterer.at materials.scatterer.Scatterer.mean_brdf_per_sr
        materials.scatterer.Scatterer.sunlight_brdf_per_sr materials.scatterer.Scatterer.tilt_normals
        materials.scatterer.complete meshes.gltf._check_tree meshes.gltf._corners meshes.gltf._entry
        meshes.gltf._list meshes.gltf._whole meshes.height_field._load_cached meshes.mesh._check_count
        meshes.mesh.load_mesh meshes.mesh.warn_of_repairs meshes.mesh.warn_of_size
        surfaces.articulation.split_at_hinges surfaces.examination._first surfaces.pieces.bin_of
        surfaces.surface.Surface.evaluate_by_material surfaces.surface.Surface.scene
        surfaces.surface.Surface.shading_normals surfaces.surface.build_surface
    """,
    "shapes": """
        boulders.rock_diameters build.build capsule._on_cone craters._within craters.add_craters
        craters.crater_diameters cubesat.cubesat envisat_payload._hood fragment._bend fragment._outline
        fragment._sheet fragment.fragment juno._hexagon juno._tower materials._lambertian materials._phong
        model.CraftPart.turn rocket_body._ribbed_skirt rosetta_payload._barrel solids.Solid.facing
        solids.Solid.mirror solids.Solid.move solids.Solid.turn stardust._octagon stardust._upright
        suomi_npp._dish_at suomi_npp._patch_at suomi_npp._upright tdrs._at tdrs._radial_tube terrain._boulders
        terrain.height_at terrain.made_ground zenit_stage._bell zenit_stage._round
    """,
    "simulate": """
        _fly flash simulate
    """,
    "study": """
        budgets.range_budget.Budget.range_of_pixels budgets.range_budget.Budget.save model_card._simulate_side
        passes.pass_geometry._build_batch passes.pass_geometry._state_in_gcrs passes.pass_table.Encounters.csv
        passes.search._check_number time_history.open_loop._pointing time_history.opportunities._evaluate_flash
        time_history.timeline.Timeline.save track_quality.evaluation.Tracking.save
        track_quality.evaluation._evaluate_frame track_quality.evaluation._vector_columns
        trades.definition.Study.load trades.definition.Study.loads trades.definition.Study.number
        trades.definition.Study.numbers trades.definition.Study.replace trades.execution.Trade.save
        trades.merits._CountedFrames.__init__ trades.plan._check_field trades.results.TradeTable.of_points
        trades.results.TradeTable.ranked
    """,
    "track": """
        icp._angle_between_rad icp.align icp.sample_mesh kalman.filter_positions kalman.nis_bounds
    """,
}


def modules():
    """Return every module of the package, imported."""
    found = pkgutil.walk_packages(rso_lidar.__path__, "rso_lidar.")
    return [rso_lidar, *(importlib.import_module(it.name) for it in found if not it.name.endswith("__main__"))]


def function_of(thing):
    """Return the function behind a method, a wrapper or a kernel, if it is written in this package."""
    if isinstance(thing, property) or inspect.isclass(thing) or not hasattr(thing, "__module__"):
        return None
    function = inspect.unwrap(getattr(thing, "__func__", thing))
    ours = inspect.isfunction(function) and function.__module__.startswith("rso_lidar")
    return function if ours and function.__code__.co_filename != "<string>" else None  # a dataclass writes some itself


def members(cls):
    """Return the functions that a class defines itself, by name."""
    found = {name: function_of(value) for name, value in dict(vars(cls)).items()}
    return {name: function for name, function in found.items() if function}


def parameters(function):
    """Return the names of the parameters that a caller gives."""
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


MODULES = modules()
EXPORTED = [getattr(module, name) for module in MODULES for name in getattr(module, "__all__", ())]
CLASSES = {
    value
    for module in MODULES
    for value in vars(module).values()
    if inspect.isclass(value) and value.__module__.startswith("rso_lidar")
}
PROTOCOLS = [cls for cls in CLASSES if getattr(cls, "_is_protocol", False)]


def exported():
    """Return the functions and public methods that the package and its rooms export, each with the class it is seen in."""
    found = {function_of(thing): None for thing in EXPORTED}
    for cls in filter(inspect.isclass, EXPORTED):
        for base in inspect.getmro(cls):
            for name, function in members(base).items():
                if name == "__init__" or not name.startswith("_"):
                    found.setdefault(function, cls)
    return {function: cls for function, cls in found.items() if function and parameters(function)}


def long():
    """Return the functions and methods with many parameters, each with its class."""
    found = {}
    for holder in (*MODULES, *CLASSES):
        for name, function in members(holder).items():
            if len(parameters(function)) >= MANY and not (name.startswith("__") and name != "__init__"):
                found.setdefault(function, holder if inspect.isclass(holder) else None)
    return found


def docstrings(function, cls):
    """Return the texts that may document a function, its own first."""
    name, texts = function.__name__, [inspect.getdoc(function) or ""]
    if cls is None:
        return texts
    if name == "__init__":
        return [*texts, inspect.getdoc(cls) or ""]
    bases = [base for base in inspect.getmro(cls)[1:] if name in vars(base)]
    bases += [it for it in PROTOCOLS if name in vars(it) and all(hasattr(cls, member) for member in members(it))]
    alike = [function_of(vars(base)[name]) for base in bases]
    return texts + [inspect.getdoc(it) or "" for it in alike if it and parameters(it) == parameters(function)]


def sections(text):
    """Return the sections of a docstring by title."""
    parts = SECTION.split(text)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def described(text):
    """Return the names that a docstring describes as parameters."""
    found = sections(text)
    entries = NAMES.findall(found.get("Parameters", "") + found.get("Other Parameters", ""))
    return {name.lstrip("*") for entry in entries for name in entry.split(", ")}


def is_command(function):
    """Return whether all parameters are options or arguments of the command line that have a help text."""
    if not function.__module__.startswith("rso_lidar.cli."):
        return False
    hints = typing.get_type_hints(function, include_extras=True)
    notes = [getattr(hints[name], "__metadata__", ()) for name in parameters(function)]
    return all(any(getattr(note, "help", "") for note in of_one) for of_one in notes)


def gives(function):
    """Return whether a function returns or yields a value."""
    return inspect.signature(function).return_annotation not in (
        None,
        "None",
        "Self",
        "NoReturn",
        inspect.Signature.empty,
    )


def undescribed(function, cls):
    """Return the parameters of a function that none of its docstrings describes."""
    if is_command(function):
        return []
    names, texts = parameters(function), docstrings(function, cls)
    return min(([name for name in names if name not in described(text)] for text in texts), key=len)


def has_value(function, cls):
    """Return whether the docstrings of a function state what it returns, if it returns anything."""
    states = any(
        {"Returns", "Yields"} & sections(it).keys() or it.startswith("Return ") for it in docstrings(function, cls)
    )
    return states or not gives(function)


def faults():
    """Return what docstrings leave out, by the full name of the function."""
    found, outside = {}, exported()
    for function, cls in (long() | outside).items():
        missing = undescribed(function, cls)
        if function in outside and not has_value(function, cls):
            missing.append("Returns")
        if missing:
            found[f"{function.__module__}.{function.__qualname__}".removeprefix("rso_lidar.")] = missing
    return found


def test_functions_state_their_parameters_and_values():
    found = faults()
    waiting = {f"{room}.{name}" for room, names in NOT_YET.items() for name in names.split()}
    assert not {name: missing for name, missing in found.items() if name not in waiting}
    assert not waiting - found.keys(), "these are documented now: take them from the list"


def read(distance_m, *rows, **options):
    """Read a table.

    Parameters
    ----------
    distance_m : of the far end [m].
    *rows, **options : of the table.

    Raises
    ------
    OSError
        If there is no table.
    """


def test_what_is_left_out_is_seen():
    assert len(exported()) > 300 and len(long()) > 600 and len(PROTOCOLS) > 5
    assert described(inspect.getdoc(read)) == {"distance_m", "rows", "options"}
    assert sections(inspect.getdoc(read)).keys() == {"Parameters", "Raises"}
    assert not undescribed(read, None) and undescribed(lambda x, rows: None, None) == ["x", "rows"]
