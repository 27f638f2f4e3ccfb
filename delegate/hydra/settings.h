#ifndef HDTRAPEZE_SETTINGS_H
#define HDTRAPEZE_SETTINGS_H

#include "hdtrapeze.h"

#include "pxr/base/gf/interval.h"
#include "pxr/base/tf/token.h"
#include "pxr/base/vt/value.h"
#include "pxr/imaging/hd/renderDelegate.h"
#include "pxr/pxr.h"

#include <map>
#include <set>
#include <string>

PXR_NAMESPACE_OPEN_SCOPE

/// Settings by name that one place says: the host, a RenderSettings prim or a RenderProduct.
class HdTrapezeSettingsLayer final {
public:
    enum class Owner { Host, Settings, Product };

    explicit HdTrapezeSettingsLayer(Owner owner) : _owner(owner) {}

    /// Keeps a value in place of the one before. What is not known or cannot be is left out: false,
    /// and `why` is what to tell the user.
    bool Set(TfToken const& key, VtValue const& value, std::string* why);

    void Apply(trz_settings* settings) const;

    /// The shutter that is asked for in place of the camera's; an empty one for none.
    GfInterval Shutter() const;

private:
    Owner _owner;
    std::map<TfToken, VtValue> _values;
    /// What it ever said something about.
    std::set<TfToken> _opinions;
};

/// The library's defaults, with the ends of a shutter for hosts that override the camera's.
trz_settings HdTrapezeDefaultSettings();

/// The settings that hosts show, with their defaults.
HdRenderSettingDescriptorList HdTrapezeSettingDescriptors();

/// Our name of a setting that Hydra has a name for; others are their own.
TfToken HdTrapezeSettingName(TfToken const& key);

/// Whether a name is in the namespace of this renderer's settings.
bool HdTrapezeIsSettingName(std::string const& name);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
