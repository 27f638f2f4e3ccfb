#include "numbers.h"
#include "shapes.h"

#include "pxr/imaging/hd/meshTopology.h"

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// Hydra hands on the subsets that materials are bound to.
void _SendSubsets(HdTrapezeSyncing const& prim, HdGeomSubsets const& subsets) {
    std::vector<trz_subset> descs;
    for (HdGeomSubset const& subset : subsets) {
        trz_subset desc = {};
        desc.path = subset.id.GetText();
        desc.family = "materialBind";
        desc.family_type = TRZ_FAMILY_NON_OVERLAPPING;
        desc.element_type = TRZ_ELEMENT_FACE;
        HdTrapezeView(subset.indices, &desc.indices, &desc.index_count);
        descs.push_back(desc);
    }
    prim.Edit(trz_mesh_set_subsets, descs.data(), descs.size());
}

} // namespace

void HdTrapezeSendMesh(HdTrapezeSyncing const& prim) {
    HdMeshTopology const topology = prim.delegate->GetMeshTopology(prim.id);
    PxOsdSubdivTags const tags = prim.delegate->GetSubdivTags(prim.id);
    auto const word = [&](char const* attribute, TfToken const& word) {
        return prim.Word(attribute, word);
    };
    auto desc = HdTrapezeStruct<trz_topology>();
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
    prim.Edit(trz_mesh_set_topology, &desc);
    _SendSubsets(prim, topology.GetGeomSubsets());
}

PXR_NAMESPACE_CLOSE_SCOPE
