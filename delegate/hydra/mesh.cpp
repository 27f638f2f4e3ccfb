#include "mesh.h"

#include "numbers.h"
#include "pxr/imaging/hd/meshTopology.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

void _SetTopology(trz_id prim, SdfPath const& id, HdMeshTopology const& topology,
                  PxOsdSubdivTags const& tags, HdTrapezeRenderParam& param) {
    auto const word = [&](char const* attribute, TfToken const& word) {
        return param.Word(attribute, word, id);
    };
    trz_topology desc = {};
    desc.struct_size = sizeof(desc);
    desc.scheme = word("subdivisionScheme", topology.GetScheme());
    desc.boundary = word("interpolateBoundary", tags.GetVertexInterpolationRule());
    desc.face_varying =
        word("faceVaryingLinearInterpolation", tags.GetFaceVaryingInterpolationRule());
    desc.triangles = word("triangleSubdivisionRule", tags.GetTriangleSubdivision());
    desc.orientation = word("orientation", topology.GetOrientation());
    HdTrapezeView(topology.GetFaceVertexCounts(), &desc.face_vertex_counts, &desc.face_count);
    HdTrapezeView(topology.GetFaceVertexIndices(), &desc.face_vertex_indices, &desc.index_count);
    HdTrapezeView(topology.GetHoleIndices(), &desc.holes, &desc.hole_count);
    HdTrapezeView(tags.GetCreaseIndices(), &desc.crease_indices, &desc.crease_index_count);
    HdTrapezeView(tags.GetCreaseLengths(), &desc.crease_lengths, &desc.crease_count);
    HdTrapezeView(tags.GetCreaseWeights(), &desc.crease_sharpnesses, &desc.crease_sharpness_count);
    HdTrapezeView(tags.GetCornerIndices(), &desc.corner_indices, &desc.corner_count);
    HdTrapezeView(tags.GetCornerWeights(), &desc.corner_sharpnesses, &desc.corner_sharpness_count);
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
