#ifndef HDTRAPEZE_RENDER_PASS_H
#define HDTRAPEZE_RENDER_PASS_H

#include "products.h"

#include "pxr/base/gf/interval.h"
#include "pxr/imaging/hd/renderPass.h"
#include "pxr/imaging/hd/rprimCollection.h"
#include "pxr/pxr.h"

#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdTrapezeCamera;
class HdTrapezeRenderDelegate;
class HdTrapezeRenderSettings;

/// Starts a render where something has changed since the last one, and tells how far it is.
class HdTrapezeRenderPass final : public HdRenderPass {
public:
    HdTrapezeRenderPass(HdRenderIndex* index, HdRprimCollection const& collection,
                        HdTrapezeRenderDelegate* delegate);
    ~HdTrapezeRenderPass() override;

    bool IsConverged() const override;

protected:
    void _Execute(HdRenderPassStateSharedPtr const& state, TfTokenVector const& tags) override;
    void _Sync() override;
    void _MarkCollectionDirty() override { _collectionDirty = true; }

private:
    void _Include(TfTokenVector const& tags);
    bool _SampleMotion();
    bool _LacksShutter(HdTrapezeCamera const& camera);
    bool _LacksSamples(HdTrapezeCamera const& camera);
    bool _MakeView(HdRenderPassState const& state, HdTrapezeRenderSettings const* prim,
                   trz_settings* settings, std::vector<char const*>* aovs);
    HdTrapezeProducts _Products(HdTrapezeRenderSettings const& prim, trz_settings const& own);

    HdTrapezeRenderDelegate* const _delegate;
    bool _collectionDirty = true;
    bool _resyncing = false;
    TfTokenVector _tags;
    uint64_t _visibilityVersion = 0;
    int _refineLevel = 0;
    // The part of shutters that all prims have samples of, and when that was found.
    GfInterval _sampled;
    uint64_t _sampledEdits = 0;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
