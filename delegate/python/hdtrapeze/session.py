"""One rendering session of the C ABI, with numpy arrays in and out.

Arrays are passed without copies where they have the right type; the renderer copies what it
keeps, so nothing needs to outlive a call. Calls that take long release Python's lock.
"""

import logging
from collections.abc import Sequence

import numpy as np

from . import native
from .arrays import Arrays, text
from .camera import CameraState
from .curves import CurveTopology
from .errors import SceneError
from .implicit import Implicit
from .instances import Instances
from .lens import LENS_ATTRIBUTES
from .log import SceneLog
from .mesh import BOUNDARIES, FACE_VARYING, ORIENTATIONS, SCHEMES, TRIANGLES, Topology
from .motion import Motion
from .named import settings_struct
from .nurbs import Basis
from .nurbs_curves import NurbsBasis
from .planned import Planned, read_planned
from .points import Points, Samples
from .primvars import INTERPOLATIONS, NUMBERS, Primvar
from .products import RenderVar, fill_var
from .subsets import ELEMENTS, FAMILIES, Subset
from .transforms import Level

ffi = native.ffi

LENS_NUMBERS = (*LENS_ATTRIBUTES, "exposure_scale")

_NO_INDICES = np.zeros(0, dtype=np.int32)


class Session:
    """Owns a trz_session. Not thread-safe, but `cancel` may be called from any thread."""

    def __init__(self, log: SceneLog):
        self._lib = native.lib()
        self._constants = native.constants()
        self._log = log
        self._with_subsets: set[int] = set()
        handle = ffi.new("trz_session **")
        native.check(self._lib.trz_session_create(handle))
        self._session = handle[0]
        self._callback = ffi.callback("trz_log_fn", self._on_log)
        native.check(
            self._lib.trz_session_set_log(
                self._session, self._callback, ffi.NULL, self._constants.TRZ_LOG_INFO
            )
        )

    def close(self) -> None:
        """Frees the session; stops a render that is still running."""
        if self._session is not None:
            session, self._session = self._session, None
            self._lib.trz_session_destroy(session)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _on_log(self, _user, level, path, code, what):
        constants = self._constants
        levels = {
            constants.TRZ_LOG_ERROR: logging.ERROR,
            constants.TRZ_LOG_WARN: logging.WARNING,
            constants.TRZ_LOG_INFO: logging.INFO,
        }
        texts = (ffi.string(p).decode("utf-8", "replace") if p else "" for p in (path, code, what))
        self._log.say(levels.get(level, logging.DEBUG), *texts)

    def _call(self, function: str, *arguments) -> None:
        if self._session is None:
            raise SceneError("The renderer is closed.")
        native.check(getattr(self._lib, function)(self._session, *arguments))

    def _value(self, kind: str, name: str) -> int:
        return getattr(self._constants, f"TRZ_{kind}_{name}")

    # Prims ---------------------------------------------------------------------------------------

    def create(self, kind: str, path: str) -> int:
        """A new prim: an instancer, a camera or what shapes.Shape.kind names."""
        out = ffi.new("trz_id *")
        self._call(f"trz_{kind}_create", text(path), out)
        return out[0]

    def complete(self, prim: int) -> None:
        """Tells that nothing more comes of a prim: it can be diced while others are read."""
        self._call("trz_prim_complete", prim)

    def remove(self, prim: int) -> None:
        """Removes a prim."""
        self._call("trz_prim_remove", prim)

    def set_topology(self, prim: int, topology: Topology) -> None:
        """Sets a mesh's topology, as authored."""
        arrays = Arrays()
        value = native.new("trz_topology")
        value.scheme = self._value("SCHEME", SCHEMES[topology.scheme])
        value.boundary = self._value("BOUNDARY", BOUNDARIES[topology.boundary])
        value.face_varying = self._value("FVAR", FACE_VARYING[topology.face_varying])
        value.triangles = self._value("TRIANGLES", TRIANGLES[topology.triangles])
        value.orientation = self._value("ORIENTATION", ORIENTATIONS[topology.orientation])
        counts = {
            "face_vertex_counts": "face_count",
            "face_vertex_indices": "index_count",
            "holes": "hole_count",
            "crease_indices": "crease_index_count",
            "crease_lengths": "crease_count",
            "crease_sharpnesses": "crease_sharpness_count",
            "corner_indices": "corner_count",
            "corner_sharpnesses": "corner_sharpness_count",
        }
        for name, count in counts.items():
            array = getattr(topology, name)
            setattr(value, name, arrays.pointer(array))
            setattr(value, count, array.size)
        self._call("trz_mesh_set_topology", prim, value)

    def set_subsets(self, prim: int, subsets: list[Subset]) -> None:
        """Sets a mesh's subsets, as authored."""
        if not subsets and prim not in self._with_subsets:
            return
        self._with_subsets.add(prim)
        arrays = Arrays()
        values = arrays.keep(ffi.new("trz_subset[]", len(subsets)))
        for value, subset in zip(values, subsets, strict=True):
            value.path = arrays.keep(ffi.new("char[]", text(subset.path)))
            value.family = arrays.keep(ffi.new("char[]", text(subset.family)))
            value.family_type = self._value("FAMILY", FAMILIES[subset.family_type])
            value.element_type = self._value("ELEMENT", ELEMENTS[subset.element])
            value.indices = arrays.pointer(subset.indices)
            value.index_count = subset.indices.size
        self._call("trz_mesh_set_subsets", prim, values, len(subsets))

    def set_implicit(self, prim: int, implicit: Implicit) -> None:
        """Sets kind and sizes of an implicit prim."""
        arrays = Arrays()
        value = native.new("trz_implicit")
        value.kind = self._value("IMPLICIT", implicit.shape)
        value.axis = self._value("AXIS", implicit.axis)
        value.orientation = self._value("ORIENTATION", ORIENTATIONS[implicit.orientation])
        value.times = arrays.pointer(np.asarray(implicit.times, dtype=np.float64))
        value.sizes = arrays.pointer(implicit.sizes)
        value.sample_count = len(implicit.times)
        self._call("trz_implicit_set", prim, value)

    def set_curves(self, prim: int, topology: CurveTopology) -> None:
        """Sets basis, wrap and counts of curves, as authored."""
        arrays = Arrays()
        value = native.new("trz_curves")
        value.basis = self._value("BASIS", topology.basis)
        value.wrap = self._value("WRAP", topology.wrap)
        value.form = self._value("CURVES", topology.form)
        value.vertex_counts = arrays.pointer(topology.vertex_counts)
        value.curve_count = topology.vertex_counts.size
        self._call("trz_curves_set", prim, value)

    def set_nurbs_patch(self, prim: int, basis: Basis) -> None:
        """Sets orders, knots, ranges and weights of a NURBS patch."""
        arrays = Arrays()
        value = native.new("trz_nurbs_patch")
        value.orientation = self._value("ORIENTATION", ORIENTATIONS[basis.orientation])
        for d, name in enumerate("uv"):
            setattr(value, f"{name}_order", basis.orders[d])
            setattr(value, f"{name}_vertex_count", basis.vertex_counts[d])
            setattr(value, f"{name}_knots", arrays.pointer(basis.knots[d]))
            setattr(value, f"{name}_knot_count", basis.knots[d].size)
            setattr(value, f"{name}_range", list(basis.ranges[d]))
        value.weights = arrays.pointer(basis.weights)
        value.weight_count = basis.weights.size
        self._call("trz_nurbs_patch_set", prim, value)

    def set_nurbs_curves(self, prim: int, basis: NurbsBasis) -> None:
        """Sets orders, knots, ranges and weights of NURBS curves."""
        arrays = Arrays()
        value = native.new("trz_nurbs_curves")
        value.form = self._value("CURVES", basis.form)
        value.vertex_counts = arrays.pointer(basis.vertex_counts)
        value.orders = arrays.pointer(basis.orders)
        value.curve_count = basis.vertex_counts.size
        value.knots = arrays.pointer(basis.knots)
        value.knot_count = basis.knots.size
        value.ranges = arrays.pointer(basis.ranges)
        value.range_count = len(basis.ranges)
        value.weights = arrays.pointer(basis.weights)
        value.weight_count = basis.weights.size
        self._call("trz_nurbs_curves_set", prim, value)

    def set_points(self, prim: int, points: Points) -> None:
        """Sets the points of a mesh or NURBS patch, of curves or spheres."""
        arrays = Arrays()
        value = native.new("trz_points")
        samples = Samples(points.times, points.arrays)
        value.times, value.sample_count, value.points, value.counts = arrays.samples(samples)
        for name in ("velocities", "accelerations"):
            field = getattr(value, name)
            samples = arrays.samples(getattr(points, name))
            field.times, field.sample_count, field.values, field.counts = samples
        value.time_codes_per_second = points.time_codes_per_second
        self._call("trz_prim_set_points", prim, value)

    def set_transform(self, prim: int, levels: list[Level]) -> None:
        """Sets the transform of a prim or camera, its own level first."""
        arrays = Arrays()
        value = ffi.new("trz_transform_samples[]", len(levels))
        for i, level in enumerate(levels):
            value[i].times = arrays.pointer(np.asarray(level.times, dtype=np.float64))
            value[i].matrices = arrays.pointer(np.asarray(level.matrices, dtype=np.float64))
            value[i].count = len(level.times)
        self._call("trz_prim_set_transform", prim, value, len(levels))

    def set_primvar(self, prim: int, name: str, primvar: Primvar | None) -> None:
        """Sets a primvar, or removes it."""
        if primvar is None:
            self._call("trz_prim_set_primvar", prim, text(name), ffi.NULL)
            return
        arrays = Arrays()
        value = native.new("trz_primvar")
        samples = primvar.samples
        value.interpolation = self._value("INTERPOLATION", INTERPOLATIONS[primvar.interpolation])
        value.type = self._value("NUMBERS", NUMBERS[samples[0].values.dtype])
        value.role = self._value("ROLE", "COLOR" if primvar.is_color else "NONE")
        value.width = samples[0].values.shape[1]
        value.element_size = primvar.element_size
        value.unauthored_index = primvar.unauthored_index
        times = np.array([sample.time for sample in samples], dtype=np.float64)
        value.times = arrays.pointer(times)
        value.sample_count = len(samples)
        pointers = [arrays.bytes(sample.values) for sample in samples]
        value.values = arrays.keep(ffi.new("void *[]", pointers))
        counts = [len(sample.values) for sample in samples]
        value.value_counts = arrays.keep(ffi.new("size_t[]", counts))
        indices = [_NO_INDICES if s.indices is None else s.indices for s in samples]
        if any(array.size for array in indices):
            pointers = [arrays.pointer(array) for array in indices]
            value.indices = arrays.keep(ffi.new("int32_t *[]", pointers))
            value.index_counts = arrays.keep(ffi.new("size_t[]", [len(a) for a in indices]))
        self._call("trz_prim_set_primvar", prim, text(name), value)

    def set_instances(self, instancer: int, instances: Instances) -> None:
        """Sets the arrays of an instancer."""
        arrays = Arrays()
        value = native.new("trz_instancer")
        value.instance_count = instances.count
        value.prototype_count = instances.prototype_count
        value.prototypes = arrays.pointer(instances.prototypes)
        value.prototype_index_count = len(instances.prototypes)
        value.mask = arrays.pointer(instances.mask)
        value.mask_count = len(instances.mask)
        names = ("positions", "orientations", "scales", "matrices")
        rates = ("velocities", "accelerations", "angular_velocities")
        for name in (*names, *rates):
            field = getattr(value, name)
            of = "double" if name == "matrices" else "float"
            samples = arrays.samples(getattr(instances, name), of)
            field.times, field.sample_count, field.values, field.counts = samples
        value.time_codes_per_second = instances.time_codes_per_second
        self._call("trz_instancer_set", instancer, value)

    def set_part(self, prim: int, instancer: int, prototype: int) -> None:
        """Makes a prim or instancer part of a prototype; instancer 0: it stands by itself."""
        self._call("trz_prim_set_instancer", prim, instancer, prototype)

    def set_motion(self, prim: int, motion: Motion) -> None:
        """How the motion of a prim is blurred."""
        samples = min(motion.nonlinear_samples, 2**32 - 1)
        self._call("trz_prim_set_motion", prim, motion.blur_scale, samples)

    def set_double_sided(self, prim: int, double_sided: bool) -> None:
        """Whether both sides of a prim's surface are outsides."""
        self._call("trz_prim_set_double_sided", prim, int(double_sided))

    def set_matte(self, prim: int, matte: bool) -> None:
        """Makes a prim a matte object (a holdout), or a surface like any other."""
        self._call("trz_prim_set_matte", prim, int(matte))

    def set_pick_id(self, prim: int, pick_id: int) -> None:
        """What the primId AOV holds for this prim."""
        self._call("trz_prim_set_pick_id", prim, pick_id)

    def set_camera(self, camera: int, state: CameraState) -> None:
        """Sets a camera and renders through it."""
        value = native.new("trz_camera")
        native.check(self._lib.trz_camera_default(value))
        arrays = Arrays()
        orthographic = state.projection == "orthographic"
        value.projection = self._value(
            "PROJECTION", "ORTHOGRAPHIC" if orthographic else "PERSPECTIVE"
        )
        lenses = arrays.keep(ffi.new("trz_lens_sample[]", len(state.lens_samples)))
        for lens, (time, numbers) in zip(lenses, state.lens_samples, strict=True):
            lens.time = time
            for name, number in numbers.items():
                setattr(lens, name, number)
        for name in LENS_NUMBERS:
            setattr(value, name, getattr(state, name))
        value.lens_samples, value.lens_sample_count = lenses, len(lenses)
        value.clipping_near, value.clipping_far = state.clipping
        value.shutter_open, value.shutter_close = state.shutter
        for name, number in vars(state.aperture).items():
            setattr(value, f"aperture_{name}", number)
        curve = state.shutter_curve
        value.shutter_curve_type = self._value("SHUTTER", "BEZIER" if curve.bezier else "LINEAR")
        value.shutter_curve = arrays.pointer(curve.points)
        value.shutter_curve_count = len(curve.points)
        value.clipping_planes = arrays.pointer(state.clipping_planes)
        value.clipping_plane_count = len(state.clipping_planes)
        self._call("trz_camera_set", camera, value)
        self.set_transform(camera, state.levels)
        self._call("trz_session_set_active_camera", camera)

    # Settings and rendering ----------------------------------------------------------------------

    def set_settings(self, named: dict, **fields) -> None:
        """Sets the settings that are `named` (see named.settings) and these fields of trz_settings;
        the renderer's defaults for the rest."""
        value = settings_struct(named)
        for name, field in fields.items():
            setattr(value, name, field)
        self._call("trz_session_set_settings", value)

    def set_aovs(self, names: list[str]) -> None:
        """Which AOVs the next render fills."""
        texts = [ffi.new("char[]", text(name)) for name in names]
        self._call("trz_session_set_aovs", ffi.new("char *[]", texts), len(texts))

    def commit(self) -> None:
        """Applies edits, dices and builds."""
        self._call("trz_session_commit")

    def start(self) -> None:
        """Commits what is pending and starts to render."""
        self._call("trz_render_start")

    def wait(self, seconds: float) -> bool:
        """Whether the render has finished within `seconds` (negative: however long it takes)."""
        finished = ffi.new("uint32_t *")
        self._call("trz_render_wait", float(seconds), finished)
        return bool(finished[0])

    def cancel(self) -> None:
        """Stops the render; what was rendered stays."""
        self._call("trz_render_cancel")

    def progress(self):
        """How far the render is, a trz_progress."""
        value = native.new("trz_progress")
        self._call("trz_render_progress", value)
        return value

    def statistics(self) -> dict[str, float]:
        """Statistics of the last commit and render by name."""
        value = native.new("trz_statistics")
        self._call("trz_statistics_get", value)
        names = [name for name, _ in ffi.typeof("trz_statistics").fields]
        return {name: getattr(value, name) for name in names if name != "struct_size"}

    def explain(self) -> str:
        """What the renderer simulates for this scene, and which prim calls for it."""
        return self._long_text("trz_explain")

    def dump(self) -> str:
        """The scene as the renderer has it, as text; see record's sister command `dump`."""
        return self._long_text("trz_scene_dump")

    def _long_text(self, function: str) -> str:
        needed = ffi.new("size_t *")
        self._call(function, ffi.NULL, 0, needed)
        buffer = ffi.new("char[]", int(needed[0]))
        self._call(function, buffer, len(buffer), needed)
        return ffi.string(buffer).decode("utf-8", "replace")

    # Results -------------------------------------------------------------------------------------

    def _describe(self, name: str):
        description = native.new("trz_aov_desc")
        self._call("trz_aov_describe", text(name), description)
        return description

    def aov_origin(self, name: str) -> tuple[int, int]:
        """Column and row of the image that an AOV's first pixel is in: below 0 with overscan."""
        description = self._describe(name)
        return description.origin_x, description.origin_y

    def aov(self, name: str) -> np.ndarray:
        """A copy of an AOV, (height, width) or (height, width, components), rows top down."""
        description = self._describe(name)
        integers = description.format == self._constants.TRZ_FORMAT_INT32
        shape = (description.height, description.width, description.components)
        array = np.empty(shape, dtype=np.int32 if integers else np.float32)
        self._call("trz_aov_read", text(name), ffi.from_buffer(array), array.nbytes)
        return array[..., 0] if description.components == 1 else array

    def write_image(
        self,
        path: str,
        kind: str,
        aovs: list[str],
        metadata: dict[str, str],
        named: dict | None = None,
        color: str = "LINEAR",
        render_vars: Sequence[RenderVar] = (),
        partial: bool = False,
    ) -> None:
        """Writes an EXR or PNG; whatever goes wrong, a file that was there stays.

        Of the settings that are `named`, compression and pixelType say how an EXR is written. What
        is `partial` goes beside the file.
        """
        arrays = Arrays()
        value = native.new("trz_image")
        value.type = self._value("IMAGE", kind)
        exr = settings_struct(named or {})
        value.pixel_type, value.compression = exr.pixel_type, exr.compression
        value.color = self._value("COLOR", color)
        value.partial = partial
        names = [ffi.new("char[]", text(name)) for name in aovs]
        pairs = [ffi.new("char[]", text(str(t))) for pair in metadata.items() for t in pair]
        value.aovs = aov_list = ffi.new("char *[]", names) if names else ffi.NULL
        value.aov_count = len(names)
        value.metadata = metadata_list = ffi.new("char *[]", pairs) if pairs else ffi.NULL
        value.metadata_count = len(pairs)
        places = arrays.keep(ffi.new("trz_render_var[]", len(render_vars)))
        for place, var in zip(places, render_vars, strict=True):
            fill_var(place, var, arrays)
        value.vars, value.var_count = places, len(render_vars)
        self._call("trz_image_write", text(path), value)
        del aov_list, metadata_list  # alive until here

    def render_var_aov(self, var: RenderVar) -> str | None:
        """The AOV that a render var is written from; None, after a warning, where there is none."""
        arrays = Arrays()
        value = ffi.new("trz_render_var *")
        fill_var(value, var, arrays)
        capacity = 4096
        buffer, needed = ffi.new("char[]", capacity), ffi.new("size_t *")
        try:
            self._call("trz_render_var_aov", value, buffer, capacity, needed)
        except native.NativeError as error:
            if error.code != self._constants.TRZ_ERROR_UNSUPPORTED:
                raise
            return None
        return ffi.string(buffer).decode("utf-8", "replace")

    def plan(self, view, products: list) -> list[Planned]:
        """What becomes of each of these trz_products beside a trz_view, and of the view's own image
        at the end."""
        out = ffi.new("trz_plan **")
        pointers = ffi.new("trz_product *[]", products) if products else ffi.NULL
        self._call("trz_plan_create", view, pointers, len(products), out)
        try:
            return [read_planned(out[0], number) for number in range(len(products) + 1)]
        finally:
            self._lib.trz_plan_destroy(out[0])

    def trace_rays(self, rays: np.ndarray) -> np.ndarray:
        """Traces (n, 9) f32 rays: origin, direction, time, t_min, t_max; world space.

        Gives a structured array with the fields of trz_hit.
        """
        rays = np.ascontiguousarray(rays, dtype=np.float32).reshape(-1, 9)
        hits = np.zeros(len(rays), dtype=HIT)
        assert ffi.sizeof("trz_ray") == 36
        assert ffi.sizeof("trz_hit") == HIT.itemsize
        self._call(
            "trz_trace_rays",
            ffi.cast("trz_ray *", ffi.from_buffer(rays)),
            ffi.cast("trz_hit *", ffi.from_buffer(hits)),
            len(rays),
        )
        return hits


HIT = np.dtype(
    [
        ("t", "f4"),
        ("u", "f4"),
        ("v", "f4"),
        ("normal", "f4", 3),
        ("prim_id", "i4"),
        ("instance_id", "i4"),
        ("element_id", "i4"),
        ("grid", "u4"),
        ("cell", "u4"),
    ]
)
"""trz_hit as a numpy type."""
