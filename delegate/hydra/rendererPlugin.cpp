#include "rendererPlugin.h"

#include "renderDelegate.h"

#include "pxr/imaging/hd/rendererPluginRegistry.h"

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

PXR_NAMESPACE_CLOSE_SCOPE
