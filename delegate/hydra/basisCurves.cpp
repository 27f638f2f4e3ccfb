#include "basisCurves.h"

#include "words.h"

#include "pxr/imaging/hd/basisCurvesTopology.h"
#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

uint32_t _Basis(HdBasisCurvesTopology const& topology, SdfPath const& id,
                HdTrapezeRenderParam& param) {
    static std::map<TfToken, uint32_t> const words = {
        {HdTokens->bezier, TRZ_BASIS_BEZIER},
        {HdTokens->bspline, TRZ_BASIS_BSPLINE},
        {HdTokens->catmullRom, TRZ_BASIS_CATMULL_ROM},
        {HdTokens->hermite, TRZ_BASIS_HERMITE},
    };
    return topology.GetCurveType() == HdTokens->linear
               ? TRZ_BASIS_LINEAR
               : HdTrapezeWord(words, topology.GetCurveBasis(), TRZ_BASIS_BEZIER, id, param);
}

uint32_t _Wrap(TfToken const& word, SdfPath const& id, HdTrapezeRenderParam& param) {
    static std::map<TfToken, uint32_t> const words = {
        {HdTokens->nonperiodic, TRZ_WRAP_NONPERIODIC},
        {HdTokens->segmented, TRZ_WRAP_NONPERIODIC},
        {HdTokens->periodic, TRZ_WRAP_PERIODIC},
        {HdTokens->pinned, TRZ_WRAP_PINNED},
    };
    return HdTrapezeWord(words, word, TRZ_WRAP_NONPERIODIC, id, param);
}

} // namespace

uint32_t HdTrapezeCurveForm(HdSceneDelegate* delegate, SdfPath const& id,
                            HdTrapezeRenderParam& param) {
    static TfToken const primvar("trapeze:curves");
    static std::map<TfToken, uint32_t> const words = {
        {TfToken("auto"), TRZ_CURVES_AUTO},
        {TfToken("ribbons"), TRZ_CURVES_RIBBONS},
        {TfToken("tubes"), TRZ_CURVES_TUBES},
    };
    VtValue const value = delegate->Get(id, primvar);
    TfToken const word = value.IsHolding<std::string>() ? TfToken(value.UncheckedGet<std::string>())
                                                        : value.GetWithDefault<TfToken>();
    return HdTrapezeWord(words, word, TRZ_CURVES_DEFAULT, id, param);
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
    if (topology.GetCurveWrap() == HdTokens->segmented) {
        // Points two by two.
        int points = 0;
        for (int count : counts) {
            points += std::max(count, 0);
        }
        counts.assign(points / 2, 2);
    }
    trz_curves desc = {};
    desc.struct_size = sizeof(desc);
    desc.basis = _Basis(topology, id, param);
    desc.wrap = _Wrap(topology.GetCurveWrap(), id, param);
    desc.form = HdTrapezeCurveForm(delegate, id, param);
    desc.vertex_counts = counts.cdata();
    desc.curve_count = counts.size();
    param.Edit(trz_curves_set(param.Session(), prim.Id(), &desc), id);
}

PXR_NAMESPACE_CLOSE_SCOPE
