"""A stage with render settings and products, for the tests of what they mean."""

import numpy as np
from hdtrapeze.cli import main
from images import read_exr
from pxr import Gf, Sdf, UsdRender
from scenes import add_camera, add_quad, new_stage, quad_coverage

FAST = ["--samples", "4", "--filter", "box"]
HALF = quad_coverage(-2, -2, 2, 2, size=20)
FULL = quad_coverage(-2, -2, 2, 2)


class Scene:
    """A stage with a quad, cameras and render settings; saved before each run."""

    def __init__(self, folder):
        self.folder = folder
        self.runs = 0
        self.flags = FAST
        self.stage = new_stage()
        self.stage.SetStartTimeCode(1)
        add_camera(self.stage, "/main_cam")
        self.quad = add_quad(self.stage)
        self.settings = UsdRender.Settings.Define(self.stage, "/Render/settings")
        self.settings.CreateResolutionAttr(Gf.Vec2i(40, 40))
        self.var("color")

    def var(self, name, **attributes):
        """A RenderVar /Render/Vars/NAME; attributes by their USD names, __ for a colon."""
        var = UsdRender.Var.Define(self.stage, f"/Render/Vars/{name}")
        for key, value in attributes.items():
            key = key.replace("__", ":")
            attribute = var.GetPrim().GetAttribute(key)
            if not attribute:
                attribute = var.GetPrim().CreateAttribute(key, Sdf.ValueTypeNames.String)
            attribute.Set(value)
        return var

    def product(self, name, *variables, file=None, **attributes):
        """A RenderProduct /Render/NAME of the settings that writes NAME.exr."""
        product = UsdRender.Product.Define(self.stage, f"/Render/{name}")
        product.CreateProductNameAttr(str(self.folder / (file or f"{name}.exr")))
        paths = [f"/Render/Vars/{var}" for var in variables or ["color"]]
        product.CreateOrderedVarsRel().SetTargets(paths)
        for key, value in attributes.items():
            product.GetPrim().GetAttribute(key).Set(value)
        self.settings.CreateProductsRel().AddTarget(product.GetPath())
        return product

    def path(self, name):
        return self.folder / name

    def run(self, *flags, out="own.png", named=True):
        """The exit code of `record` with the settings named, or only in the stage's metadata."""
        # USD may still have the layer of the run before.
        self.runs += 1
        file = self.path(f"scene{self.runs}.usda")
        self.stage.SetMetadata("renderSettingsPrimPath", "/Render/settings")
        self.stage.GetRootLayer().Export(str(file))
        named = ["-rs", "/Render/settings"] if named and "-rp" not in flags else []
        arguments = ["record", file, self.path(out), *self.flags, *named, *flags]
        try:
            return main([str(argument) for argument in arguments])
        except SystemExit as stop:
            return stop.code


def warnings(capsys):
    """Warnings on stderr; fails where there is more, but for what they left unwritten."""
    lines = capsys.readouterr().err.splitlines()
    lines = [line for line in lines if not line.startswith("error: Not everything was written: ")]
    assert all(line.startswith("warning: ") for line in lines), lines
    return [line.removeprefix("warning: ") for line in lines]


def one(capsys, path, *words):
    """Asserts that there was one warning, about `path`, with `words` in it."""
    lines = warnings(capsys)
    assert len(lines) == 1, lines
    assert lines[0].startswith(f"{path}: "), lines
    for word in words:
        assert word in lines[0], lines


def alpha(path):
    return np.asarray(read_exr(path)["A"], np.float32)
