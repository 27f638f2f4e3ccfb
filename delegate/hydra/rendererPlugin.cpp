#include "rendererPlugin.h"

#include "renderDelegate.h"

#include "pxr/imaging/hd/rendererPluginRegistry.h"
#include "pxr/imaging/hd/version.h"
#if HD_API_VERSION >= 101
#include "pxr/imaging/hd/retainedDataSource.h"
#include "pxr/imaging/hd/sceneIndexCreateArgsSchema.h"
#elif HD_API_VERSION >= 90
#include "pxr/imaging/hd/retainedDataSource.h"
#include "pxr/imaging/hd/sceneIndexInputArgsSchema.h"
#endif
#if HD_API_VERSION >= 103
#include "pxr/imaging/hd/rendererCreateArgsSchema.h"
#elif HD_API_VERSION >= 83
#include "pxr/imaging/hd/rendererCreateArgs.h"
#endif

PXR_NAMESPACE_OPEN_SCOPE

TF_REGISTRY_FUNCTION(TfType) { HdRendererPluginRegistry::Define<HdTrapezeRendererPlugin>(); }

HdRenderDelegate* HdTrapezeRendererPlugin::CreateRenderDelegate() {
    return new HdTrapezeRenderDelegate({});
}

HdRenderDelegate*
HdTrapezeRendererPlugin::CreateRenderDelegate(HdRenderSettingsMap const& settings) {
    return new HdTrapezeRenderDelegate(settings);
}

void HdTrapezeRendererPlugin::DeleteRenderDelegate(HdRenderDelegate* delegate) { delete delegate; }

#if HD_API_VERSION < 98
bool HdTrapezeRendererPlugin::IsSupported(bool) const { return true; }
#endif
#if HD_API_VERSION >= 83 && HD_API_VERSION < 103
bool HdTrapezeRendererPlugin::IsSupported(HdRendererCreateArgs const&, std::string*) const {
    return true;
}
#endif
#if HD_API_VERSION >= 103
bool HdTrapezeRendererPlugin::IsSupported(HdRendererCreateArgsSchema const&, std::string*) const {
    return true;
}
#endif

#if HD_API_VERSION >= 101
HdContainerDataSourceHandle HdTrapezeRendererPlugin::GetSceneIndexCreateArgs() const {
    auto const yes = HdRetainedTypedSampledDataSource<bool>::New(true);
    return HdSceneIndexCreateArgsSchema::Builder()
        .SetMotionBlurSupport(yes)
        .SetCameraMotionBlurSupport(yes)
        .Build();
}
#elif HD_API_VERSION >= 90
HdContainerDataSourceHandle HdTrapezeRendererPlugin::GetSceneIndexInputArgs() const {
    auto const yes = HdRetainedTypedSampledDataSource<bool>::New(true);
    return HdSceneIndexInputArgsSchema::Builder()
        .SetMotionBlurSupport(yes)
        .SetCameraMotionBlurSupport(yes)
        .Build();
}
#endif

PXR_NAMESPACE_CLOSE_SCOPE
