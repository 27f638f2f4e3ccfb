#include "nurbsCurves.h"

#include "basisCurves.h"
#include "numbers.h"
#include "schema.h"

#include "pxr/base/gf/vec2d.h"
#include "pxr/imaging/hd/nurbsCurvesSchema.h"

PXR_NAMESPACE_OPEN_SCOPE

void HdTrapezeNurbsCurves::_SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                                      HdTrapezeRenderParam& param, HdDirtyBits bits) {
    SdfPath const& id = GetId();
    if (!(bits & (HdChangeTracker::DirtyTopology | HdChangeTracker::DirtyPoints |
                  HdChangeTracker::DirtyPrimvar))) {
        return;
    }
    auto const& t = *HdNurbsCurvesSchemaTokens;
    HdTrapezeSchema const schema(delegate, id, HdDataSourceLocator(t.nurbsCurves));
    VtIntArray const counts = schema.Get(t.curveVertexCounts, VtIntArray());
    VtIntArray orders = schema.Get(t.order, VtIntArray());
    orders.resize(counts.size()); // those that are missing are none
    VtDoubleArray const knots = schema.Get(t.knots, VtDoubleArray());
    VtVec2dArray const ranges = schema.Get(t.ranges, VtVec2dArray());
    VtDoubleArray const weights =
        delegate->Get(id, TfToken("pointWeights")).GetWithDefault<VtDoubleArray>();
    trz_nurbs_curves desc = {};
    desc.struct_size = sizeof(desc);
    desc.form = HdTrapezeCurveForm(delegate, id, param);
    desc.vertex_counts = counts.cdata();
    desc.orders = orders.cdata();
    desc.curve_count = counts.size();
    HdTrapezeView(knots, &desc.knots, &desc.knot_count);
    desc.ranges = ranges.empty() ? nullptr : ranges.cdata()->data();
    desc.range_count = ranges.size();
    HdTrapezeView(weights, &desc.weights, &desc.weight_count);
    param.Edit(trz_nurbs_curves_set(param.Session(), prim.Id(), &desc), id);
}

PXR_NAMESPACE_CLOSE_SCOPE
