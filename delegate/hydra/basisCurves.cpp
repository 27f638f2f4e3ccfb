#include "basisCurves.h"

#include "pxr/imaging/hd/basisCurvesTopology.h"
#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

uint32_t HdTrapezeCurveForm(HdSceneDelegate* delegate, SdfPath const& id,
                            HdTrapezeRenderParam& param) {
    static TfToken const primvar("trapeze:curves");
    VtValue const value = delegate->Get(id, primvar);
    TfToken const word = value.IsHolding<std::string>() ? TfToken(value.UncheckedGet<std::string>())
                                                        : value.GetWithDefault<TfToken>();
    return param.Word(primvar.GetText(), word, id);
}

// The bounds and axes that stand for a model have indices; authored curves have none.
void HdTrapezeBasisCurves::_SyncIndices(HdTrapezePrim* prim, HdSceneDelegate* delegate,
                                        HdDirtyBits* bits) {
    if (!(*bits & HdChangeTracker::DirtyTopology)) {
        return;
    }
    VtIntArray const indices = GetBasisCurvesTopology(delegate).GetCurveIndices();
    if (indices != prim->Indices()) {
        prim->SetIndices(indices);
        *bits |= HdChangeTracker::DirtyPoints | HdChangeTracker::DirtyPrimvar;
    }
}

void HdTrapezeBasisCurves::_SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                                      HdTrapezeRenderParam& param, HdDirtyBits bits) {
    SdfPath const& id = GetId();
    if (!(bits & (HdChangeTracker::DirtyTopology | HdChangeTracker::DirtyPrimvar))) {
        return;
    }
    HdBasisCurvesTopology const topology = GetBasisCurvesTopology(delegate);
    VtIntArray counts = topology.GetCurveVertexCounts();
    TfToken wrap = topology.GetCurveWrap();
    if (wrap == HdTokens->segmented) {
        // Hydra's word for lines of two points each.
        wrap = HdTokens->nonperiodic;
        int points = 0;
        for (int count : counts) {
            points += std::max(count, 0);
        }
        counts.assign(points / 2, 2);
    }
    trz_curves desc = {};
    desc.struct_size = sizeof(desc);
    desc.basis = topology.GetCurveType() == HdTokens->linear
                     ? TRZ_BASIS_LINEAR
                     : param.Word("basis", topology.GetCurveBasis(), id);
    desc.wrap = param.Word("wrap", wrap, id);
    desc.form = HdTrapezeCurveForm(delegate, id, param);
    desc.vertex_counts = counts.cdata();
    desc.curve_count = counts.size();
    param.Edit(trz_curves_set(param.Session(), prim.Id(), &desc), id);
}

PXR_NAMESPACE_CLOSE_SCOPE
