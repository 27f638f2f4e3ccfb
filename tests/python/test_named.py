"""The renderer's settings are the library's, in Options as in flags."""

import pytest
from hdtrapeze import Options, UsageError
from hdtrapeze.named import settings


def test_options_have_the_librarys_defaults():
    own = {name: setting for name, setting in settings().items() if setting.default is not None}
    fields = vars(Options())
    found = {name: fields[own[name].field] for name in own if own[name].field in fields}
    assert found == {name: own[name].default for name in found}
    assert len(found) == 13
    # What the host says in other fields, or not at all.
    assert set(own) - set(found) == {
        *("overrideShutter", "shutterOpen", "shutterClose", "timeCodesPerSecond"),
        *("disableMotionBlur", "disableDepthOfField"),
    }


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"samples": 0}, "Samples cannot be 0: it must be from 1 to 1048576"),
        ({"samples": 2.5}, "Samples cannot be 2.5: it must be a whole number"),
        ({"samples": True}, "Samples cannot be True: it must be a whole number"),
        ({"samples": 10**30}, "it must be from 1 to 1048576"),
        ({"shading_rate": "fine"}, "it must be a number"),
        ({"filter": "sharp"}, "it must be one of box, gaussian, mitchell, blackman-harris"),
        ({"cull": 1}, "it must be one of none, back, front, backUnlessDoubleSided"),
        ({"shutter": (1, 0)}, "Shutter cannot be 1 0: the shutter closes before it opens"),
        ({"shutter": (1,)}, "it must be 2 numbers"),
        ({"pixel_type": "double"}, "Pixel type cannot be double: it must be one of half, float"),
        ({"motion_blur": 3, "camera_light": 1}, "it must be true or false"),
    ],
)
def test_what_cannot_be_is_the_librarys_to_say(values, words):
    with pytest.raises(UsageError, match=words):
        Options(**values).validate()


def test_values_have_the_settings_type():
    all_settings = settings()
    assert type(all_settings["shadingRate"].value(2)) is float
    assert all_settings["shutter"].value([0, 1]) == (0.0, 1.0)
    with pytest.raises(TypeError):
        all_settings["samples"].value("4")
    with pytest.raises(ValueError, match="from 1 to"):
        all_settings["samples"].value(0)
