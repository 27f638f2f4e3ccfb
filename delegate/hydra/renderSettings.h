#ifndef HDTRAPEZE_RENDER_SETTINGS_H
#define HDTRAPEZE_RENDER_SETTINGS_H

#include "settings.h"

#include "pxr/imaging/hd/renderSettings.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

class HdRenderIndex;
class HdTrapezeRenderParam;

/// A RenderSettings prim: its settings of this renderer, its products. One of them is the active
/// one, which the host's scene globals name.
class HdTrapezeRenderSettings final : public HdRenderSettings {
public:
    explicit HdTrapezeRenderSettings(SdfPath const& id) : HdRenderSettings(id) {}

    void Finalize(HdRenderParam* renderParam) override;

    /// Adds what the prim says, but for the effects that it switches off: products may not.
    void Apply(trz_settings* settings) const { _layer.Apply(settings); }
    void DisableEffects(trz_settings* settings) const;

    /// Says which of the included purposes the host has no prims of: it alone can ask for them.
    void CheckPurposes(TfTokenVector const& tags, HdTrapezeRenderParam& param) const;

private:
    void _Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
               HdDirtyBits const* dirtyBits) override;
    void _Read(HdRenderIndex& index, HdTrapezeRenderParam& param);

    HdTrapezeSettingsLayer _layer{HdTrapezeSettingsLayer::Owner::Settings};
    bool _disableMotionBlur = false;
    bool _disableDepthOfField = false;
};

/// The settings of this renderer among a prim's namespaced ones. What cannot be gives a warning.
HdTrapezeSettingsLayer HdTrapezeReadNamespaced(HdTrapezeSettingsLayer::Owner owner,
                                               VtDictionary const& settings, SdfPath const& id,
                                               HdTrapezeRenderParam& param);

/// A number of the host's scene globals, such as the current frame.
double HdTrapezeSceneGlobal(HdRenderIndex const& index, char const* name, double fallback);

/// Whether a RenderSettings prim or a RenderProduct has instantaneousShutter, the older name of
/// disableMotionBlur. Only scene indices tell.
bool HdTrapezeIsInstantaneous(HdRenderIndex const& index, SdfPath const& id);

/// Resolution and data window of a RenderSettings prim; as they are where the host does not tell.
void HdTrapezeReadShape(HdRenderIndex const& index, SdfPath const& id, trz_view* view);

/// The active RenderSettings prim; null for none.
HdTrapezeRenderSettings const* HdTrapezeActiveSettings(HdRenderIndex const& index);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
