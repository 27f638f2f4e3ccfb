#include "mesh.h"

#include "words.h"

#include "pxr/imaging/hd/meshTopology.h"
#include "pxr/imaging/pxOsd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

uint32_t _Scheme(TfToken const& word, SdfPath const& id, HdTrapezeRenderParam& param) {
    static std::map<TfToken, uint32_t> const words = {
        {PxOsdOpenSubdivTokens->catmullClark, TRZ_SCHEME_CATMULL_CLARK},
        {PxOsdOpenSubdivTokens->loop, TRZ_SCHEME_LOOP},
        {PxOsdOpenSubdivTokens->bilinear, TRZ_SCHEME_BILINEAR},
        {PxOsdOpenSubdivTokens->none, TRZ_SCHEME_NONE},
    };
    return HdTrapezeWord(words, word, TRZ_SCHEME_CATMULL_CLARK, id, param);
}

uint32_t _Boundary(TfToken const& word, SdfPath const& id, HdTrapezeRenderParam& param) {
    static std::map<TfToken, uint32_t> const words = {
        {PxOsdOpenSubdivTokens->none, TRZ_BOUNDARY_NONE},
        {PxOsdOpenSubdivTokens->edgeOnly, TRZ_BOUNDARY_EDGE_ONLY},
        {PxOsdOpenSubdivTokens->edgeAndCorner, TRZ_BOUNDARY_EDGE_AND_CORNER},
    };
    return HdTrapezeWord(words, word, TRZ_BOUNDARY_EDGE_AND_CORNER, id, param);
}

uint32_t _FaceVarying(TfToken const& word, SdfPath const& id, HdTrapezeRenderParam& param) {
    static std::map<TfToken, uint32_t> const words = {
        {PxOsdOpenSubdivTokens->none, TRZ_FVAR_NONE},
        {PxOsdOpenSubdivTokens->cornersOnly, TRZ_FVAR_CORNERS_ONLY},
        {PxOsdOpenSubdivTokens->cornersPlus1, TRZ_FVAR_CORNERS_PLUS1},
        {PxOsdOpenSubdivTokens->cornersPlus2, TRZ_FVAR_CORNERS_PLUS2},
        {PxOsdOpenSubdivTokens->boundaries, TRZ_FVAR_BOUNDARIES},
        {PxOsdOpenSubdivTokens->all, TRZ_FVAR_ALL},
    };
    return HdTrapezeWord(words, word, TRZ_FVAR_CORNERS_PLUS1, id, param);
}

uint32_t _Triangles(TfToken const& word, SdfPath const& id, HdTrapezeRenderParam& param) {
    static std::map<TfToken, uint32_t> const words = {
        {PxOsdOpenSubdivTokens->catmullClark, TRZ_TRIANGLES_CATMULL_CLARK},
        {PxOsdOpenSubdivTokens->smooth, TRZ_TRIANGLES_SMOOTH},
    };
    return HdTrapezeWord(words, word, TRZ_TRIANGLES_CATMULL_CLARK, id, param);
}

void _SetTopology(trz_id prim, SdfPath const& id, HdMeshTopology const& topology,
                  PxOsdSubdivTags const& tags, HdTrapezeRenderParam& param) {
    VtIntArray const& counts = topology.GetFaceVertexCounts();
    VtIntArray const& indices = topology.GetFaceVertexIndices();
    VtIntArray const& holes = topology.GetHoleIndices();
    VtIntArray const& creases = tags.GetCreaseIndices();
    VtIntArray const& lengths = tags.GetCreaseLengths();
    VtFloatArray const& sharpnesses = tags.GetCreaseWeights();
    VtIntArray const& corners = tags.GetCornerIndices();
    VtFloatArray const& cornerSharpnesses = tags.GetCornerWeights();
    trz_topology desc = {};
    desc.struct_size = sizeof(desc);
    desc.scheme = _Scheme(topology.GetScheme(), id, param);
    desc.boundary = _Boundary(tags.GetVertexInterpolationRule(), id, param);
    desc.face_varying = _FaceVarying(tags.GetFaceVaryingInterpolationRule(), id, param);
    desc.triangles = _Triangles(tags.GetTriangleSubdivision(), id, param);
    desc.orientation = HdTrapezeOrientation(topology.GetOrientation());
    desc.face_vertex_counts = counts.cdata();
    desc.face_count = counts.size();
    desc.face_vertex_indices = indices.cdata();
    desc.index_count = indices.size();
    desc.holes = holes.cdata();
    desc.hole_count = holes.size();
    desc.crease_indices = creases.cdata();
    desc.crease_index_count = creases.size();
    desc.crease_lengths = lengths.cdata();
    desc.crease_count = lengths.size();
    desc.crease_sharpnesses = sharpnesses.cdata();
    desc.crease_sharpness_count = sharpnesses.size();
    desc.corner_indices = corners.cdata();
    desc.corner_count = corners.size();
    desc.corner_sharpnesses = cornerSharpnesses.cdata();
    desc.corner_sharpness_count = cornerSharpnesses.size();
    param.Edit(trz_mesh_set_topology(param.Session(), prim, &desc), id);
}

// Hydra hands on the subsets that materials are bound to.
void _SetSubsets(trz_id prim, SdfPath const& id, HdGeomSubsets const& subsets,
                 HdTrapezeRenderParam& param) {
    std::vector<trz_subset> descs;
    for (HdGeomSubset const& subset : subsets) {
        trz_subset desc = {};
        desc.path = subset.id.GetText();
        desc.family = "materialBind";
        desc.family_type = TRZ_FAMILY_NON_OVERLAPPING;
        desc.element_type = TRZ_ELEMENT_FACE;
        desc.indices = subset.indices.cdata();
        desc.index_count = subset.indices.size();
        descs.push_back(desc);
    }
    param.Edit(trz_mesh_set_subsets(param.Session(), prim, descs.data(), descs.size()), id);
}

} // namespace

void HdTrapezeMesh::_SyncShape(HdTrapezePrim const& prim, HdSceneDelegate* delegate,
                               HdTrapezeRenderParam& param, HdDirtyBits bits) {
    SdfPath const& id = GetId();
    if (HdChangeTracker::IsTopologyDirty(bits, id) ||
        HdChangeTracker::IsSubdivTagsDirty(bits, id)) {
        HdMeshTopology const topology = GetMeshTopology(delegate);
        _SetTopology(prim.Id(), id, topology, GetSubdivTags(delegate), param);
        _SetSubsets(prim.Id(), id, topology.GetGeomSubsets(), param);
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
