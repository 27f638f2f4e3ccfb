#ifndef HDTRAPEZE_RENDERER_PLUGIN_H
#define HDTRAPEZE_RENDERER_PLUGIN_H

#include "pxr/imaging/hd/rendererPlugin.h"
#include "pxr/imaging/hd/version.h"
#include "pxr/pxr.h"
#if HD_API_VERSION >= 103
#include "pxr/imaging/hd/rendererCreateArgsSchema.h"
#elif HD_API_VERSION >= 83
#include "pxr/imaging/hd/rendererCreateArgs.h"
#endif

PXR_NAMESPACE_OPEN_SCOPE

/// What Hydra's registry finds: makes render delegates. Needs no GPU.
class HdTrapezeRendererPlugin final : public HdRendererPlugin {
public:
    HdRenderDelegate* CreateRenderDelegate() override;
    HdRenderDelegate* CreateRenderDelegate(HdRenderSettingsMap const& settings) override;
    void DeleteRenderDelegate(HdRenderDelegate* delegate) override;

#if HD_API_VERSION < 98
    bool IsSupported(bool = true) const override { return true; }
#endif
#if HD_API_VERSION >= 103
    bool IsSupported(HdRendererCreateArgsSchema const&, std::string*) const override {
        return true;
    }
#elif HD_API_VERSION >= 83
    bool IsSupported(HdRendererCreateArgs const&, std::string*) const override { return true; }
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
