#ifndef HDTRAPEZE_REGISTRY_H
#define HDTRAPEZE_REGISTRY_H

#include "pxr/pxr.h"
#include "pxr/usd/sdf/path.h"

#include <map>
#include <mutex>

PXR_NAMESPACE_OPEN_SCOPE

/// Who there is of a kind, by path; not owned. From any thread.
template <class T> class HdTrapezeRegistry final {
public:
    void Add(SdfPath const& id, T* one) {
        std::lock_guard<std::mutex> lock(_mutex);
        _all[id] = one;
    }

    void Remove(SdfPath const& id) {
        std::lock_guard<std::mutex> lock(_mutex);
        _all.erase(id);
    }

    /// Null where there is none.
    T* Find(SdfPath const& id) const {
        std::lock_guard<std::mutex> lock(_mutex);
        auto const found = _all.find(id);
        return found == _all.end() ? nullptr : found->second;
    }

    /// In the order of paths.
    std::map<SdfPath, T*> All() const {
        std::lock_guard<std::mutex> lock(_mutex);
        return _all;
    }

private:
    mutable std::mutex _mutex;
    std::map<SdfPath, T*> _all;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
