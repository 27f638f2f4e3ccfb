#include "numbers.h"
#include "schema.h"
#include "shapes.h"

#include "pxr/base/gf/vec2d.h"
#include "pxr/imaging/hd/nurbsCurvesSchema.h"
#include "pxr/imaging/hd/nurbsPatchSchema.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

VtDoubleArray _Weights(HdTrapezeSyncing const& prim) {
    static TfToken const primvar("pointWeights");
    return prim.delegate->Get(prim.id, primvar).GetWithDefault<VtDoubleArray>();
}

} // namespace

void HdTrapezeSendNurbsCurves(HdTrapezeSyncing const& prim) {
    auto const& t = *HdNurbsCurvesSchemaTokens;
    HdTrapezeSchema const schema(prim.delegate, prim.id, HdDataSourceLocator(t.nurbsCurves));
    VtIntArray const counts = schema.Get(t.curveVertexCounts, VtIntArray());
    VtIntArray orders = schema.Get(t.order, VtIntArray());
    orders.resize(counts.size()); // those that are missing are none
    VtDoubleArray const knots = schema.Get(t.knots, VtDoubleArray());
    VtVec2dArray const ranges = schema.Get(t.ranges, VtVec2dArray());
    VtDoubleArray const weights = _Weights(prim);
    auto desc = HdTrapezeStruct<trz_nurbs_curves>();
    desc.form = HdTrapezeCurveForm(prim);
    HdTrapezeView(counts, &desc.vertex_counts, &desc.curve_count);
    desc.orders = orders.cdata();
    HdTrapezeView(knots, &desc.knots, &desc.knot_count);
    desc.ranges = ranges.empty() ? nullptr : ranges.cdata()->data();
    desc.range_count = ranges.size();
    HdTrapezeView(weights, &desc.weights, &desc.weight_count);
    prim.Edit(trz_nurbs_curves_set, &desc);
}

void HdTrapezeSendNurbsPatch(HdTrapezeSyncing const& prim) {
    auto const& t = *HdNurbsPatchSchemaTokens;
    HdTrapezeSchema const schema(prim.delegate, prim.id, HdDataSourceLocator(t.nurbsPatch));
    HdTrapezeSchema const trim(prim.delegate, prim.id,
                               HdDataSourceLocator(t.nurbsPatch, t.trimCurve));
    if (!trim.Get(TfToken("counts"), VtIntArray()).empty()) {
        prim.param.WarnOnce(prim.id, "trim curves are not supported; it is rendered untrimmed");
    }
    VtDoubleArray const uKnots = schema.Get(t.uKnots, VtDoubleArray());
    VtDoubleArray const vKnots = schema.Get(t.vKnots, VtDoubleArray());
    GfVec2d const uRange = schema.Get(t.uRange, GfVec2d(0.0));
    GfVec2d const vRange = schema.Get(t.vRange, GfVec2d(0.0));
    VtDoubleArray const weights = _Weights(prim);
    auto desc = HdTrapezeStruct<trz_nurbs_patch>();
    desc.orientation = prim.Word("orientation", schema.Get(t.orientation, TfToken()));
    desc.u_order = schema.Get(t.uOrder, 0);
    desc.v_order = schema.Get(t.vOrder, 0);
    desc.u_vertex_count = schema.Get(t.uVertexCount, 0);
    desc.v_vertex_count = schema.Get(t.vVertexCount, 0);
    HdTrapezeView(uKnots, &desc.u_knots, &desc.u_knot_count);
    HdTrapezeView(vKnots, &desc.v_knots, &desc.v_knot_count);
    std::copy_n(uRange.data(), 2, desc.u_range);
    std::copy_n(vRange.data(), 2, desc.v_range);
    HdTrapezeView(weights, &desc.weights, &desc.weight_count);
    prim.Edit(trz_nurbs_patch_set, &desc);
    prim.Edit(trz_prim_set_double_sided, schema.Get(t.doubleSided, false));
}

PXR_NAMESPACE_CLOSE_SCOPE
