#include "nurbsPatch.h"

#include "numbers.h"
#include "schema.h"

#include "pxr/base/gf/vec2d.h"
#include "pxr/imaging/hd/nurbsPatchSchema.h"

PXR_NAMESPACE_OPEN_SCOPE

void HdTrapezeNurbsPatch::_SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                                     HdTrapezeRenderParam& param, HdDirtyBits bits) {
    SdfPath const& id = GetId();
    if (!(bits & (HdChangeTracker::DirtyTopology | HdChangeTracker::DirtyPoints |
                  HdChangeTracker::DirtyPrimvar | HdChangeTracker::DirtyDoubleSided))) {
        return;
    }
    auto const& t = *HdNurbsPatchSchemaTokens;
    HdTrapezeSchema const schema(delegate, id, HdDataSourceLocator(t.nurbsPatch));
    HdTrapezeSchema const trim(delegate, id, HdDataSourceLocator(t.nurbsPatch, t.trimCurve));
    if (!trim.Get(TfToken("counts"), VtIntArray()).empty()) {
        param.WarnOnce(id, "trim curves are not supported; it is rendered untrimmed");
    }
    VtDoubleArray const uKnots = schema.Get(t.uKnots, VtDoubleArray());
    VtDoubleArray const vKnots = schema.Get(t.vKnots, VtDoubleArray());
    GfVec2d const uRange = schema.Get(t.uRange, GfVec2d(0.0));
    GfVec2d const vRange = schema.Get(t.vRange, GfVec2d(0.0));
    VtDoubleArray const weights =
        delegate->Get(id, TfToken("pointWeights")).GetWithDefault<VtDoubleArray>();
    trz_nurbs_patch desc = {};
    desc.struct_size = sizeof(desc);
    desc.orientation = param.Word("orientation", schema.Get(t.orientation, TfToken()), id);
    desc.u_order = schema.Get(t.uOrder, 0);
    desc.v_order = schema.Get(t.vOrder, 0);
    desc.u_vertex_count = schema.Get(t.uVertexCount, 0);
    desc.v_vertex_count = schema.Get(t.vVertexCount, 0);
    HdTrapezeView(uKnots, &desc.u_knots, &desc.u_knot_count);
    HdTrapezeView(vKnots, &desc.v_knots, &desc.v_knot_count);
    std::copy(uRange.data(), uRange.data() + 2, desc.u_range);
    std::copy(vRange.data(), vRange.data() + 2, desc.v_range);
    HdTrapezeView(weights, &desc.weights, &desc.weight_count);
    param.Edit(trz_nurbs_patch_set(param.Session(), prim.Id(), &desc), id);
    bool const sides = schema.Get(t.doubleSided, false);
    param.Edit(trz_prim_set_double_sided(param.Session(), prim.Id(), sides), id);
}

PXR_NAMESPACE_CLOSE_SCOPE
