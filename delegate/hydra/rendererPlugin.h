#ifndef HDTRAPEZE_RENDERER_PLUGIN_H
#define HDTRAPEZE_RENDERER_PLUGIN_H

#include "pxr/imaging/hd/rendererPlugin.h"
#include "pxr/imaging/hd/version.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// What Hydra's registry finds: makes render delegates. Needs no GPU.
class HdTrapezeRendererPlugin final : public HdRendererPlugin {
public:
    HdRenderDelegate* CreateRenderDelegate() override;
    HdRenderDelegate* CreateRenderDelegate(HdRenderSettingsMap const& settings) override;
    void DeleteRenderDelegate(HdRenderDelegate* delegate) override;

#if HD_API_VERSION < 103
    bool IsSupported(bool = true) const
#if HD_API_VERSION < 83
        override
#endif
    {
        return true;
    }
#endif
#if HD_API_VERSION >= 83 && HD_API_VERSION < 103
    bool IsSupported(HdRendererCreateArgs const&, std::string* = nullptr) const override {
        return true;
    }
#endif
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
