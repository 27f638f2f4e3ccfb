#include "mesh.h"

#include "words.h"

#include "pxr/imaging/hd/meshTopology.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

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
    auto const word = [&](char const* attribute, TfToken const& word) {
        return HdTrapezeWord(attribute, word, id, param);
    };
    trz_topology desc = {};
    desc.struct_size = sizeof(desc);
    desc.scheme = word("subdivisionScheme", topology.GetScheme());
    desc.boundary = word("interpolateBoundary", tags.GetVertexInterpolationRule());
    desc.face_varying =
        word("faceVaryingLinearInterpolation", tags.GetFaceVaryingInterpolationRule());
    desc.triangles = word("triangleSubdivisionRule", tags.GetTriangleSubdivision());
    desc.orientation = word("orientation", topology.GetOrientation());
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
