#ifndef HDTRAPEZE_RENDER_PASS_H
#define HDTRAPEZE_RENDER_PASS_H

#include "hdtrapeze.h"

#include "pxr/base/gf/vec2i.h"
#include "pxr/imaging/hd/renderPass.h"
#include "pxr/imaging/hd/rprimCollection.h"
#include "pxr/pxr.h"

#include <string>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

class HdTrapezeRenderDelegate;

/// Starts a render where something has changed since the last one, and tells how far it is.
class HdTrapezeRenderPass final : public HdRenderPass {
public:
    HdTrapezeRenderPass(HdRenderIndex* index, HdRprimCollection const& collection,
                        HdTrapezeRenderDelegate* delegate);

    bool IsConverged() const override;

protected:
    void _Execute(HdRenderPassStateSharedPtr const& state, TfTokenVector const& tags) override;
    void _MarkCollectionDirty() override { _collectionDirty = true; }

private:
    // What is rendered, besides the scene.
    struct _View {
        trz_id camera = 0;
        trz_settings settings = {};
        std::vector<std::string> aovs;

        bool operator==(_View const& other) const;
    };

    void _Include(TfTokenVector const& tags);
    void _Push(_View const& view);

    HdTrapezeRenderDelegate* const _delegate;
    bool _collectionDirty = true;
    bool _resyncing = false;
    TfTokenVector _tags;
    uint64_t _visibilityVersion = 0;
    int _refineLevel = 0;
    _View _view;
    uint64_t _edits = 0;
    // The camera and shutter that the host's samples were taken for.
    SdfPath _camera;
    double _shutter[2] = {0.0, 0.0};
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
