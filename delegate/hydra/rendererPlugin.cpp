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

#if HD_API_VERSION >= 90
namespace {

template <class Schema> HdContainerDataSourceHandle _MotionBlur() {
    auto const yes = HdRetainedTypedSampledDataSource<bool>::New(true);
    return typename Schema::Builder()
        .SetMotionBlurSupport(yes)
        .SetCameraMotionBlurSupport(yes)
        .Build();
}

} // namespace
#endif

#if HD_API_VERSION >= 101
HdContainerDataSourceHandle HdTrapezeRendererPlugin::GetSceneIndexCreateArgs() const {
    return _MotionBlur<HdSceneIndexCreateArgsSchema>();
}
#elif HD_API_VERSION >= 90
HdContainerDataSourceHandle HdTrapezeRendererPlugin::GetSceneIndexInputArgs() const {
    return _MotionBlur<HdSceneIndexInputArgsSchema>();
}
#endif

PXR_NAMESPACE_CLOSE_SCOPE
