#include "shapes.h"

#include "pxr/imaging/hd/changeTracker.h"
#include "pxr/imaging/hd/tokens.h"

PXR_NAMESPACE_OPEN_SCOPE

std::vector<HdTrapezeShape> const& HdTrapezeShapes() {
    using Tracker = HdChangeTracker;
    static auto const shapes = [] {
        auto const& t = *HdPrimTypeTokens;
        HdDirtyBits const curves = Tracker::DirtyTopology | Tracker::DirtyPrimvar;
        HdDirtyBits const nurbs = curves | Tracker::DirtyPoints;
        HdDirtyBits const patch = nurbs | Tracker::DirtyDoubleSided;
        std::vector<HdTrapezeShape> shapes = {
            {t.mesh, trz_mesh_create, true, HdTrapezeSendMesh,
             Tracker::DirtyTopology | Tracker::DirtySubdivTags},
            {t.basisCurves, trz_curves_create, true, HdTrapezeSendBasisCurves, curves,
             HdTrapezeCurveIndices},
            {t.nurbsCurves, trz_nurbs_curves_create, true, HdTrapezeSendNurbsCurves, nurbs},
            {t.nurbsPatch, trz_nurbs_patch_create, true, HdTrapezeSendNurbsPatch, patch},
            // Spheres as wide as the primvar widths says.
            {t.points, trz_spheres_create, true},
            {t.volume},
            {t.tetMesh},
        };
        for (char const* const type : {"cube", "sphere", "plane", "cone", "cylinder", "cylinder_1",
                                       "capsule", "capsule_1"}) {
            shapes.push_back({TfToken(type), trz_implicit_create, false, HdTrapezeSendImplicit,
                              patch | Tracker::DirtyExtent});
        }
        return shapes;
    }();
    return shapes;
}

PXR_NAMESPACE_CLOSE_SCOPE
