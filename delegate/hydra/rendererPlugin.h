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

#if HD_API_VERSION < 98
    bool IsSupported(bool gpuEnabled = true) const override;
#endif
#if HD_API_VERSION >= 83 && HD_API_VERSION < 103
    bool IsSupported(HdRendererCreateArgs const& args, std::string* reason) const override;
#endif
#if HD_API_VERSION >= 103
    bool IsSupported(HdRendererCreateArgsSchema const& args, std::string* reason) const override;
#endif

// What scene indices do for motion blur, they are to do for this renderer.
#if HD_API_VERSION >= 101
    HdContainerDataSourceHandle GetSceneIndexCreateArgs() const override;
#elif HD_API_VERSION >= 90
    HdContainerDataSourceHandle GetSceneIndexInputArgs() const override;
#endif
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
