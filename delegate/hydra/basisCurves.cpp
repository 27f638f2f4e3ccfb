#include "numbers.h"
#include "shapes.h"

#include "pxr/imaging/hd/basisCurvesTopology.h"
#include "pxr/imaging/hd/tokens.h"

#include <algorithm>

PXR_NAMESPACE_OPEN_SCOPE

// The bounds and axes that stand for a model have indices; authored curves have none.
VtIntArray HdTrapezeCurveIndices(HdSceneDelegate* delegate, SdfPath const& id) {
    return delegate->GetBasisCurvesTopology(id).GetCurveIndices();
}

uint32_t HdTrapezeCurveForm(HdTrapezeSyncing const& prim) {
    static TfToken const primvar("trapeze:curves");
    VtValue const word = VtValue::Cast<TfToken>(prim.delegate->Get(prim.id, primvar));
    return prim.Word(primvar.GetText(), word.GetWithDefault<TfToken>());
}

void HdTrapezeSendBasisCurves(HdTrapezeSyncing const& prim) {
    HdBasisCurvesTopology const topology = prim.delegate->GetBasisCurvesTopology(prim.id);
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
    auto desc = HdTrapezeStruct<trz_curves>();
    desc.basis = topology.GetCurveType() == HdTokens->linear
                     ? TRZ_BASIS_LINEAR
                     : prim.Word("basis", topology.GetCurveBasis());
    desc.wrap = prim.Word("wrap", wrap);
    desc.form = HdTrapezeCurveForm(prim);
    HdTrapezeView(counts, &desc.vertex_counts, &desc.curve_count);
    prim.Edit(trz_curves_set, &desc);
}

PXR_NAMESPACE_CLOSE_SCOPE
