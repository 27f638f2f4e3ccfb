#include "settings.h"

#include "tokens.h"

#include "pxr/base/gf/half.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/tf/stringUtils.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>
#include <cmath>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

TF_DEFINE_PUBLIC_TOKENS(HdTrapezeSettingsTokens, HDTRAPEZE_SETTINGS_TOKENS);

namespace {

// Why a value cannot be; empty where it can.
using _Why = std::string;

_Why _Integer(VtValue const& value, int64_t least, int64_t most, int64_t* out) {
    VtValue const whole = VtValue::Cast<int64_t>(value);
    if (value.IsHolding<bool>() || value.IsHolding<float>() || value.IsHolding<double>() ||
        value.IsHolding<GfHalf>() || !whole.IsHolding<int64_t>()) {
        return "it must be a whole number";
    }
    *out = whole.UncheckedGet<int64_t>();
    if (*out < least || *out > most) {
        return TfStringPrintf("it must be from %lld to %lld", static_cast<long long>(least),
                              static_cast<long long>(most));
    }
    return {};
}

template <class T> _Why _Whole(VtValue const& value, int64_t least, int64_t most, T* out) {
    int64_t number = 0;
    _Why const why = _Integer(value, least, most, &number);
    if (why.empty()) {
        *out = static_cast<T>(number);
    }
    return why;
}

template <class T> _Why _Real(VtValue const& value, double least, double most, T* out) {
    VtValue const number = VtValue::Cast<double>(value);
    if (value.IsHolding<bool>() || !number.IsHolding<double>()) {
        return "it must be a number";
    }
    double const real = number.UncheckedGet<double>();
    if (!(real >= least && real <= most)) {
        return TfStringPrintf("it must be from %g to %g", least, most);
    }
    *out = static_cast<T>(real);
    return {};
}

template <class T> _Why _Flag(VtValue const& value, T* out, bool isInverse = false) {
    if (!value.IsHolding<bool>()) {
        return "it must be true or false";
    }
    *out = static_cast<T>(value.UncheckedGet<bool>() != isInverse);
    return {};
}

// `words` are in the order of the C ABI's constants, from `first` on.
_Why _Word(VtValue const& value, std::vector<std::string> const& words, uint32_t first,
           uint32_t* out) {
    std::string const word = value.IsHolding<TfToken>() ? value.UncheckedGet<TfToken>().GetString()
                                                        : value.GetWithDefault<std::string>();
    auto const found = std::find(words.begin(), words.end(), word);
    if (found == words.end()) {
        return "it must be one of " + TfStringJoin(words, ", ");
    }
    *out = first + static_cast<uint32_t>(found - words.begin());
    return {};
}

// Times beyond this are a mistake.
constexpr double _longest = 1e6;

_Why _Shutter(VtValue const& value, trz_settings* out) {
    VtValue const pair = VtValue::Cast<GfVec2d>(value);
    if (!pair.IsHolding<GfVec2d>()) {
        return "it must be 2 numbers";
    }
    GfVec2d const shutter = pair.UncheckedGet<GfVec2d>();
    if (!(std::abs(shutter[0]) < _longest && std::abs(shutter[1]) < _longest)) {
        return "the shutter is absurdly long";
    }
    if (shutter[1] < shutter[0]) {
        return "the shutter closes before it opens";
    }
    out->override_shutter = 1;
    out->shutter_open = shutter[0];
    out->shutter_close = shutter[1];
    return {};
}

struct _Setting {
    TfToken key;
    // What hosts call it; settings without a label are not shown.
    char const* label;
    VtValue fallback;
    bool isOfPrims;
    _Why (*read)(VtValue const&, HdTrapezeSettings*);
};

std::vector<_Setting> const& _Settings() {
    auto const& t = *HdTrapezeSettingsTokens;
    using S = HdTrapezeSettings;
    using V = VtValue;
    static std::vector<_Setting> const settings = {
        {t.samples, "Samples per pixel", V(64), true,
         [](V const& v, S* s) { return _Whole(v, 1, 1 << 20, &s->render.samples); }},
        {t.shadingRate, "Shading rate (pixels)", V(1.0f), true,
         [](V const& v, S* s) { return _Real(v, 0.01, 1000.0, &s->render.shading_rate); }},
        {t.filter, "Pixel filter", V(std::string("gaussian")), true,
         [](V const& v, S* s) {
             return _Word(v, {"box", "gaussian", "mitchell", "blackman-harris"}, TRZ_FILTER_BOX,
                          &s->render.filter);
         }},
        {t.filterWidth, "Filter width (pixels, 0: the filter's own)", V(0.0f), true,
         [](V const& v, S* s) { return _Real(v, 0.0, 32.0, &s->render.filter_width); }},
        {t.overrideShutter, "Override the camera's shutter", V(false), false,
         [](V const& v, S* s) { return _Flag(v, &s->render.override_shutter); }},
        {t.shutterOpen, "Shutter open (frames)", V(-0.25f), false,
         [](V const& v, S* s) { return _Real(v, -_longest, _longest, &s->render.shutter_open); }},
        {t.shutterClose, "Shutter close (frames)", V(0.25f), false,
         [](V const& v, S* s) { return _Real(v, -_longest, _longest, &s->render.shutter_close); }},
        {t.shutter, nullptr, V(), true, [](V const& v, S* s) { return _Shutter(v, &s->render); }},
        {t.disableMotionBlur, "Disable motion blur", V(false), false,
         [](V const& v, S* s) { return _Flag(v, &s->render.disable_motion_blur); }},
        {t.disableDepthOfField, "Disable depth of field", V(false), false,
         [](V const& v, S* s) { return _Flag(v, &s->render.disable_defocus); }},
        {t.cameraLight, "Light at the camera, where the host has lights", V(true), true,
         [](V const& v, S* s) { return _Flag(v, &s->cameraLight); }},
        {t.curves, "Curves as", V(std::string("auto")), true,
         [](V const& v, S* s) {
             return _Word(v, {"auto", "ribbons", "tubes"}, TRZ_CURVES_AUTO, &s->render.curves);
         }},
        {t.cull, "Sides that rays pass through", V(std::string("none")), true,
         [](V const& v, S* s) {
             return _Word(v, {"none", "back", "front", "backUnlessDoubleSided"}, TRZ_CULL_NONE,
                          &s->render.cull);
         }},
        {t.maxMicropolygons, "Most micropolygons (0: the renderer's own)", V(0), true,
         [](V const& v, S* s) { return _Whole(v, 0, INT64_MAX, &s->render.max_micropolygons); }},
        {t.seed, "Seed", V(0), true,
         [](V const& v, S* s) { return _Whole(v, 0, UINT32_MAX, &s->render.seed); }},
        {t.threads, "Threads (0: all cores)", V(0), false,
         [](V const& v, S* s) { return _Whole(v, 0, 4096, &s->render.threads); }},
        {t.backend, "Backend", V(std::string("auto")), false,
         [](V const& v, S* s) {
             return _Word(v, {"auto", "cpu", "gpu"}, TRZ_BACKEND_AUTO, &s->render.backend);
         }},
        {t.timeCodesPerSecond, "Time codes per second", V(24.0f), true,
         [](V const& v, S* s) {
             s->isRateTold = true;
             return _Real(v, 1e-6, 1e6, &s->timeCodesPerSecond);
         }},
        {t.compression, nullptr, V(), true,
         [](V const& v, S* s) {
             return _Word(v, {"none", "rle", "zips", "zip", "piz"}, TRZ_COMPRESSION_NONE,
                          &s->compression);
         }},
        {t.pixelType, nullptr, V(), true,
         [](V const& v, S* s) {
             return _Word(v, {"half", "float"}, TRZ_PIXEL_HALF, &s->pixelType);
         }},
    };
    return settings;
}

_Setting const* _Find(TfToken const& key) {
    auto const& all = _Settings();
    auto const found =
        std::find_if(all.begin(), all.end(), [&](_Setting const& s) { return s.key == key; });
    return found == all.end() ? nullptr : &*found;
}

} // namespace

HdTrapezeSettings::HdTrapezeSettings() {
    render.struct_size = sizeof(render);
    trz_settings_default(&render);
    render.shutter_open = -0.25;
    render.shutter_close = 0.25;
}

bool HdTrapezeSettingsLayer::Set(TfToken const& key, VtValue const& value, std::string* why) {
    _Setting const* const setting = _Find(key);
    bool const hadOpinion = _values.erase(key) > 0;
    if (!setting || (_owner == Owner::Prim && !setting->isOfPrims)) {
        *why = key.GetString() + " is no setting of this renderer; it is ignored";
        return false;
    }
    HdTrapezeSettings trial;
    std::string const reason = setting->read(value, &trial);
    if (!reason.empty()) {
        *why = key.GetString() + " is " + TfStringify(value) + ", which cannot be: " + reason +
               "; " +
               (setting->fallback.IsEmpty() ? "it is ignored"
                                            : TfStringify(setting->fallback) + " is used");
        return false;
    }
    // A host that begins with a default has no opinion of its own: prims may have one.
    if (_owner == Owner::Prim || hadOpinion || setting->fallback.IsEmpty() ||
        VtValue::CastToTypeOf(value, setting->fallback) != setting->fallback) {
        _values[key] = value;
    }
    return true;
}

void HdTrapezeSettingsLayer::Apply(HdTrapezeSettings* settings) const {
    for (auto const& [key, value] : _values) {
        _Find(key)->read(value, settings);
    }
}

GfInterval HdTrapezeSettingsLayer::Shutter() const {
    HdTrapezeSettings settings;
    Apply(&settings);
    trz_settings const& s = settings.render;
    return s.override_shutter
               ? GfInterval(s.shutter_open, std::max(s.shutter_open, s.shutter_close))
               : GfInterval();
}

trz_settings HdTrapezeFinish(HdTrapezeSettings const& settings) {
    trz_settings finished = settings.render;
    finished.shutter_close = std::max(finished.shutter_open, finished.shutter_close);
    if (!finished.override_shutter) {
        finished.shutter_open = finished.shutter_close = 0.0;
    }
    return finished;
}

HdRenderSettingDescriptorList HdTrapezeSettingDescriptors() {
    HdRenderSettingDescriptorList descriptors;
    for (_Setting const& setting : _Settings()) {
        if (setting.label) {
            descriptors.push_back({setting.label, setting.key, setting.fallback});
        }
    }
    return descriptors;
}

TfToken HdTrapezeSettingName(TfToken const& key) {
    if (key == HdRenderSettingsTokens->convergedSamplesPerPixel) {
        return HdTrapezeSettingsTokens->samples;
    }
    return key == HdRenderSettingsTokens->threadLimit ? HdTrapezeSettingsTokens->threads : key;
}

bool HdTrapezeIsSettingName(std::string const& name) {
    return TfStringStartsWith(name, "trapeze:");
}

PXR_NAMESPACE_CLOSE_SCOPE
