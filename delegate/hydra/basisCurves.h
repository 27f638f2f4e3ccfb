#ifndef HDTRAPEZE_BASIS_CURVES_H
#define HDTRAPEZE_BASIS_CURVES_H

#include "rprim.h"

#include "pxr/imaging/hd/basisCurves.h"
#include "pxr/pxr.h"

PXR_NAMESPACE_OPEN_SCOPE

/// Curves: ribbons or tubes as wide as the primvar widths says.
class HdTrapezeBasisCurves final : public HdTrapezeRprim<HdBasisCurves> {
public:
    explicit HdTrapezeBasisCurves(SdfPath const& id)
        : HdTrapezeRprim(id, trz_curves_create, HdTrapezePrim::Points::Yes) {}

private:
    void _SyncIndices(HdTrapezePrim* prim, HdSceneDelegate* delegate, HdDirtyBits* bits) override;
    void _SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                    HdTrapezeRenderParam& param, HdDirtyBits bits) override;
};

/// What curves without normals are rendered as, as the primvar trapeze:curves says: TRZ_CURVES_*.
uint32_t HdTrapezeCurveForm(HdSceneDelegate* delegate, SdfPath const& id,
                            HdTrapezeRenderParam& param);

PXR_NAMESPACE_CLOSE_SCOPE

#endif
