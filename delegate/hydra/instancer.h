#ifndef HDTRAPEZE_INSTANCER_H
#define HDTRAPEZE_INSTANCER_H

#include "hdtrapeze.h"
#include "prim.h"
#include "renderParam.h"
#include "samples.h"

#include "pxr/base/vt/array.h"
#include "pxr/imaging/hd/instancer.h"
#include "pxr/pxr.h"

#include <map>
#include <memory>
#include <mutex>
#include <set>

PXR_NAMESPACE_OPEN_SCOPE

/// An instancer: one of the session's for each list of instances that its prototypes have.
///
/// Hydra tells prototypes apart by lists of instance numbers. Parts of a prototype have the same
/// list, so they share an instancer of the session, which holds the values of those instances
/// alone, in the list's order: instanceId is a place in the list, as pickers expect.
class HdTrapezeInstancer final : public HdInstancer {
public:
    HdTrapezeInstancer(HdSceneDelegate* delegate, SdfPath const& id) : HdInstancer(delegate, id) {}

    void Sync(HdSceneDelegate* delegate, HdRenderParam* renderParam,
              HdDirtyBits* dirtyBits) override;
    void Finalize(HdRenderParam* renderParam) override;

    /// Makes a geometry prim part of the prototype that these instances show. From any thread.
    void SetPrimPart(SdfPath const& id, trz_id prim, VtIntArray const& instances);

    /// Makes another instancer part of the prototype that these instances show. From any thread.
    void SetInstancerPart(SdfPath const& id, HdTrapezeInstancer* child,
                          VtIntArray const& instances);

    void RemovePart(SdfPath const& id);

    /// Makes the session's instancers what the lists and values ask for; then CommitParts of all
    /// instancers links them with their parts. Not during Sync.
    bool CommitGroups(HdTrapezeRenderParam& param);
    void CommitParts(HdTrapezeRenderParam& param);

private:
    // Values of one instance primvar.
    struct _Primvar {
        HdTrapezeSamples<VtValue> samples;
        TfToken role;
        int elementSize = 1;
    };

    struct _Part {
        VtIntArray instances;
        trz_id prim = 0;
        HdTrapezeInstancer* child = nullptr;
    };

    // An instancer of the session.
    struct _Group {
        trz_id id = 0;
        HdTrapezeMotion motion;
        bool hasValues = false;
        bool hasTransform = false;
    };

    struct _Less {
        bool operator()(VtIntArray const& a, VtIntArray const& b) const;
    };

    void _CheckLengths(HdTrapezeRenderParam& param);
    void _SetValues(trz_id group, VtIntArray const& instances, HdTrapezeRenderParam& param);
    void _Link(trz_id part, trz_id group, HdTrapezeRenderParam& param);

    HdTrapezeTransform _transform;
    std::map<TfToken, _Primvar> _primvars;
    // Between samples, instanceTransforms go along arcs; see HdTrapezeTransform.
    bool _matricesTurn = false;
    HdTrapezeMotion _motion;
    bool _visible = true;
    bool _created = false;
    // That the number of instances changes.

    std::mutex _mutex;
    std::map<SdfPath, _Part> _parts;
    bool _partsChanged = true;
    // One of each list of instances: hosts give every part a copy.
    std::set<VtIntArray, _Less> _lists;

    std::map<VtIntArray, _Group, _Less> _groups;
    // Of what is part of a group: which.
    std::map<trz_id, trz_id> _links;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
