#include "settings.h"

#include "numbers.h"

#include "pxr/base/gf/half.h"
#include "pxr/base/gf/vec2d.h"
#include "pxr/base/tf/stringUtils.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

struct _Setting {
    TfToken key;
    // What hosts call it; settings without a label are not shown.
    std::string label;
    VtValue fallback;
    bool isOfPrims;
};

VtValue _FromLibrary(trz_value const& value) {
    switch (value.kind) {
    case TRZ_VALUE_BOOL:
        return VtValue(value.integer != 0);
    case TRZ_VALUE_INTEGER:
        return VtValue(static_cast<int>(value.integer));
    case TRZ_VALUE_REAL:
        return VtValue(static_cast<float>(value.numbers[0]));
    case TRZ_VALUE_TEXT:
        return VtValue(std::string(value.text));
    default:
        return VtValue();
    }
}

std::vector<_Setting> const& _Settings() {
    static std::vector<_Setting> const settings = [] {
        std::vector<_Setting> all;
        auto one = HdTrapezeStruct<trz_setting>();
        for (size_t i = 0; trz_setting_describe(i, &one) == TRZ_OK; ++i) {
            all.push_back({TfToken(one.name), one.label ? one.label : "",
                           _FromLibrary(one.fallback), one.of_prims != 0});
        }
        return all;
    }();
    return settings;
}

_Setting const* _Find(TfToken const& key) {
    auto const& all = _Settings();
    auto const found =
        std::find_if(all.begin(), all.end(), [&](_Setting const& s) { return s.key == key; });
    return found == all.end() ? nullptr : &*found;
}

bool _Set(trz_settings* settings, TfToken const& key, VtValue const& value) {
    VtValue const real = VtValue::Cast<double>(value);
    VtValue const whole = VtValue::Cast<int64_t>(value);
    VtValue const pair = VtValue::Cast<GfVec2d>(value);
    trz_value given = {};
    if (value.IsHolding<bool>()) {
        given.kind = TRZ_VALUE_BOOL;
        given.integer = value.UncheckedGet<bool>();
    } else if (value.IsHolding<TfToken>() || value.IsHolding<std::string>()) {
        given.kind = TRZ_VALUE_TEXT;
        given.text = value.IsHolding<TfToken>() ? value.UncheckedGet<TfToken>().GetText()
                                                : value.UncheckedGet<std::string>().c_str();
    } else if (whole.IsHolding<int64_t>() && !value.IsHolding<float>() &&
               !value.IsHolding<double>() && !value.IsHolding<GfHalf>()) {
        given.kind = TRZ_VALUE_INTEGER;
        given.integer = whole.UncheckedGet<int64_t>();
    } else if (real.IsHolding<double>()) {
        given.kind = TRZ_VALUE_REAL;
        given.numbers[0] = real.UncheckedGet<double>();
    } else if (pair.IsHolding<GfVec2d>()) {
        given.kind = TRZ_VALUE_PAIR;
        std::copy_n(pair.UncheckedGet<GfVec2d>().data(), 2, given.numbers);
    }
    return trz_settings_set(settings, key.GetText(), &given) == TRZ_OK;
}

} // namespace

bool HdTrapezeSettingsLayer::Set(TfToken const& key, VtValue const& value, std::string* why) {
    _Setting const* const setting = _Find(key);
    _values.erase(key);
    if (!setting || (_owner != Owner::Host && !setting->isOfPrims)) {
        *why = key.GetString() +
               (setting ? " is the host's to set" : " is no setting of this renderer") +
               "; it is ignored";
        return false;
    }
    // A host that begins with a default has no opinion of its own: prims may have one.
    if (_owner != Owner::Host || setting->fallback.IsEmpty() ||
        VtValue::CastToTypeOf(value, setting->fallback) != setting->fallback) {
        _opinions.insert(key);
    }
    trz_settings trial = HdTrapezeDefaultSettings();
    if (!_Set(&trial, key, value)) {
        std::string used = setting->fallback.IsEmpty() ? "it is ignored"
                           : _owner == Owner::Product ? "the render settings' is used"
                                                      : TfStringify(setting->fallback) + " is used";
        if (_owner == Owner::Host && setting->isOfPrims && !setting->fallback.IsEmpty()) {
            used = "the render settings' is used, else " + TfStringify(setting->fallback);
        }
        *why = key.GetString() + " is " + TfStringify(value) +
               ", which cannot be: " + trz_last_error() + "; " + used;
        return false;
    }
    if (_opinions.count(key)) {
        _values[key] = value;
    }
    return true;
}

void HdTrapezeSettingsLayer::Apply(trz_settings* settings) const {
    for (auto const& [key, value] : _values) {
        _Set(settings, key, value);
    }
    // Hosts set both ends on their own.
    settings->shutter_close = std::max(settings->shutter_open, settings->shutter_close);
}

GfInterval HdTrapezeSettingsLayer::Shutter() const {
    trz_settings settings = HdTrapezeDefaultSettings();
    Apply(&settings);
    return settings.override_shutter ? GfInterval(settings.shutter_open, settings.shutter_close)
                                     : GfInterval();
}

trz_settings HdTrapezeDefaultSettings() {
    auto settings = HdTrapezeStruct<trz_settings>();
    trz_settings_default(&settings);
    settings.shutter_open = -0.25;
    settings.shutter_close = 0.25;
    return settings;
}

HdRenderSettingDescriptorList HdTrapezeSettingDescriptors() {
    HdRenderSettingDescriptorList descriptors;
    for (_Setting const& setting : _Settings()) {
        if (!setting.label.empty()) {
            descriptors.push_back({setting.label, setting.key, setting.fallback});
        }
    }
    return descriptors;
}

TfToken HdTrapezeSettingName(TfToken const& key) {
    if (key == HdRenderSettingsTokens->convergedSamplesPerPixel) {
        return TfToken("trapeze:samples");
    }
    return key == HdRenderSettingsTokens->threadLimit ? TfToken("trapeze:threads") : key;
}

bool HdTrapezeIsSettingName(std::string const& name) {
    return TfStringStartsWith(name, "trapeze:");
}

PXR_NAMESPACE_CLOSE_SCOPE
