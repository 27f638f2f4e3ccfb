"""hdTrapeze for Python: renders USD stages with defocus and motion blur.

The package reads a stage with usd-core and drives the renderer through its C ABI. The command
`hdtrapeze record` and :class:`Renderer` are the two ways in::

    from pxr import Usd
    import hdtrapeze

    with hdtrapeze.Renderer(width=320, samples=64) as renderer:
        renderer.load(Usd.Stage.Open("scene.usda"), frame=1)
        renderer.render()
        color = renderer.aov("color")  # numpy, (height, width, 4), linear, premultiplied

Flow: stage (open) -> scene (walk, what changed) -> mesh, primvars, transforms, instances (read
USD) -> session (C ABI) -> render -> record (frames and files).
"""

import importlib

_HOMES = {
    "Options": "options",
    "Renderer": "render",
    "render_stage": "render",
    "version": "native",
    "HdTrapezeError": "errors",
    "InputError": "errors",
    "NativeError": "errors",
    "OutputError": "errors",
    "SceneError": "errors",
    "UsageError": "errors",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str):
    # Loaded when asked for: usd-core takes its time, and `hdtrapeze --help` needs none of it.
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
