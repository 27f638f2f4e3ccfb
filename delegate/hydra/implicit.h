#ifndef HDTRAPEZE_IMPLICIT_H
#define HDTRAPEZE_IMPLICIT_H

#include "rprim.h"

#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// A cube, sphere, cylinder, cone, capsule or plane, as hosts with scene indices hand them on.
class HdTrapezeImplicit final : public HdTrapezeRprim<HdTrapezePlainRprim> {
public:
    /// `type` is one of Types.
    HdTrapezeImplicit(SdfPath const& id, TfToken const& type)
        : HdTrapezeRprim(id, trz_implicit_create, HdTrapezePrim::Points::No), _type(type) {}

    static TfTokenVector const& Types();

private:
    void _SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                    HdTrapezeRenderParam& param, HdDirtyBits bits) override;

    TfToken _type;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
