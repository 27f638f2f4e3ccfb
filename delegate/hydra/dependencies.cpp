#include "pxr/imaging/hd/dependencyForwardingSceneIndex.h"
#include "pxr/imaging/hd/nurbsCurvesSchema.h"
#include "pxr/imaging/hd/nurbsPatchSchema.h"
#include "pxr/imaging/hd/primvarsSchema.h"
#include "pxr/imaging/hd/sceneIndexPlugin.h"
#include "pxr/imaging/hd/sceneIndexPluginRegistry.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Has Hydra tell of what depends on what was edited. There are no dirty bits for some schemas of
// geometry prims, whose edits would be dropped: these are told as edits of primvars, too.
class _Edits final : public HdDependencyForwardingSceneIndex {
public:
    explicit _Edits(HdSceneIndexBaseRefPtr const& input)
        : HdDependencyForwardingSceneIndex(input) {}

private:
    void _PrimsDirtied(HdSceneIndexBase const& sender,
                       HdSceneIndexObserver::DirtiedPrimEntries const& entries) override {
        static HdDataSourceLocatorSet const dropped = {HdNurbsPatchSchema::GetDefaultLocator(),
                                                       HdNurbsCurvesSchema::GetDefaultLocator(),
                                                       HdDataSourceLocator(TfToken("plane"))};
        HdSceneIndexObserver::DirtiedPrimEntries told = entries;
        for (auto& [id, locators] : told) {
            if (locators.Intersects(dropped)) {
                locators.insert(HdPrimvarsSchema::GetDefaultLocator());
            }
        }
        HdDependencyForwardingSceneIndex::_PrimsDirtied(sender, told);
    }
};

} // namespace

/// Has Hydra tell of all edits, also of what depends on what was edited: skinned meshes on
/// skeletons, render settings on their products. Hosts leave this to each renderer; it comes after
/// all other scene indices.
class HdTrapezeDependencies final : public HdSceneIndexPlugin {
protected:
    using HdSceneIndexPlugin::_AppendSceneIndex;
    HdSceneIndexBaseRefPtr _AppendSceneIndex(HdSceneIndexBaseRefPtr const& input,
                                             HdContainerDataSourceHandle const&) override {
        return TfCreateRefPtr(new _Edits(input));
    }
};

TF_REGISTRY_FUNCTION(TfType) { HdSceneIndexPluginRegistry::Define<HdTrapezeDependencies>(); }

TF_REGISTRY_FUNCTION(HdSceneIndexPlugin) {
    HdSceneIndexPluginRegistry::GetInstance().RegisterSceneIndexForRenderer(
        "Trapeze", TfToken("HdTrapezeDependencies"), nullptr, 1000,
        HdSceneIndexPluginRegistry::InsertionOrderAtEnd);
}

PXR_NAMESPACE_CLOSE_SCOPE
