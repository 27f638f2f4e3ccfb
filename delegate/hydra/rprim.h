#ifndef HDTRAPEZE_RPRIM_H
#define HDTRAPEZE_RPRIM_H

#include "prim.h"

#include "pxr/imaging/hd/changeTracker.h"
#include "pxr/imaging/hd/instancer.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneDelegate.h"
#include "pxr/pxr.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

/// A prim that Hydra has no base class for.
class HdTrapezePlainRprim : public HdRprim {
public:
    using HdRprim::HdRprim;

    TfTokenVector const& GetBuiltinPrimvarNames() const override {
        static TfTokenVector const none;
        return none;
    }
};

/// An Rprim over one of Hydra's base classes: what they have in common is HdTrapezePrim's, their
/// shape is _SyncShape's.
template <class Base> class HdTrapezeRprim : public Base {
public:
    HdTrapezeRprim(SdfPath const& id, HdTrapezePrim::Create create, HdTrapezePrim::Points points)
        : Base(id), _prim(create, points) {}

    HdDirtyBits GetInitialDirtyBitsMask() const final {
        return HdChangeTracker::AllSceneDirtyBits | HdChangeTracker::InitRepr;
    }

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam, HdDirtyBits* dirtyBits,
              TfToken const&) final {
        auto& param = *static_cast<HdTrapezeRenderParam*>(renderParam);
        HdDirtyBits bits = *dirtyBits;
        this->_UpdateVisibility(delegate, dirtyBits);
        this->_UpdateInstancer(delegate, dirtyBits);
        HdRenderIndex& index = delegate->GetRenderIndex();
        if (index.GetInstancer(this->GetInstancerId())) {
            HdInstancer::_SyncInstancerAndParents(index, this->GetInstancerId());
        }
        _SyncIndices(&_prim, delegate, &bits);
        bool const created = _prim.Id() == 0;
        if (_prim.Sync(*this, delegate, param, bits)) {
            _SyncShape(_prim, delegate, param,
                       created ? HdDirtyBits(HdChangeTracker::AllDirty) : bits);
        }
        *dirtyBits &= ~HdChangeTracker::AllSceneDirtyBits;
    }

    // Apart from Sync: prims whose tag is not asked for, or no longer, are not synced.
    void UpdateRenderTag(HdSceneDelegate* delegate, HdRenderParam* renderParam) final {
        Base::UpdateRenderTag(delegate, renderParam);
        _prim.SetRenderTag(this->GetRenderTag());
        static_cast<HdTrapezeRenderParam*>(renderParam)->MarkVisibilityDirty();
    }

    void Finalize(HdRenderParam* renderParam) final {
        _prim.Finalize(*this, *static_cast<HdTrapezeRenderParam*>(renderParam));
        Base::Finalize(renderParam);
    }

protected:
    /// Tells the prim which points its vertices are, before these are pulled. Where that changes,
    /// they are dirty.
    virtual void _SyncIndices(HdTrapezePrim*, HdSceneDelegate*, HdDirtyBits*) {}

    /// Pulls what this kind of prim alone has, where it is dirty.
    virtual void _SyncShape(HdTrapezePrim const&, HdSceneDelegate*, HdTrapezeRenderParam&,
                            HdDirtyBits) {}

    HdDirtyBits _PropagateDirtyBits(HdDirtyBits bits) const final { return bits; }

    // Every way of drawing a prim is the same here.
    void _InitRepr(TfToken const& name, HdDirtyBits*) final {
        auto const has = [&](auto const& repr) { return repr.first == name; };
        if (std::none_of(this->_reprs.begin(), this->_reprs.end(), has)) {
            this->_reprs.emplace_back(name, HdReprSharedPtr());
        }
    }

private:
    HdTrapezePrim _prim;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
