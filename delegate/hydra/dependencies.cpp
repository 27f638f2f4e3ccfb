#include "pxr/imaging/hd/dependencyForwardingSceneIndex.h"
#include "pxr/imaging/hd/sceneIndexPlugin.h"
#include "pxr/imaging/hd/sceneIndexPluginRegistry.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Has Hydra tell of what depends on what was edited: skinned meshes on skeletons, render settings
/// on their products. Hosts leave this to each renderer; it comes after all other scene indices.
class HdTrapezeDependencies final : public HdSceneIndexPlugin {
protected:
    using HdSceneIndexPlugin::_AppendSceneIndex;
    HdSceneIndexBaseRefPtr _AppendSceneIndex(HdSceneIndexBaseRefPtr const& input,
                                             HdContainerDataSourceHandle const&) override {
        return HdDependencyForwardingSceneIndex::New(input);
    }
};

TF_REGISTRY_FUNCTION(TfType) { HdSceneIndexPluginRegistry::Define<HdTrapezeDependencies>(); }

TF_REGISTRY_FUNCTION(HdSceneIndexPlugin) {
    HdSceneIndexPluginRegistry::GetInstance().RegisterSceneIndexForRenderer(
        "Trapeze", TfToken("HdTrapezeDependencies"), nullptr, 1000,
        HdSceneIndexPluginRegistry::InsertionOrderAtEnd);
}

PXR_NAMESPACE_CLOSE_SCOPE
