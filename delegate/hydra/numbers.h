#ifndef HDTRAPEZE_NUMBERS_H
#define HDTRAPEZE_NUMBERS_H

#include "hdtrapeze.h"
#include "samples.h"

#include "pxr/base/vt/array.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"

#include <cstddef>
#include <cstdint>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// One of the C ABI's structs that tell their size, all else zero.
template <class T> T HdTrapezeStruct() {
    T made = {};
    made.struct_size = sizeof(T);
    return made;
}

/// An array as the C ABI takes it. Points into it.
template <class T> void HdTrapezeView(VtArray<T> const& array, T const** first, size_t* count) {
    *first = array.cdata();
    *count = array.size();
}

/// The numbers that a VtValue holds, an array's or one value's, where it holds numbers. Points into
/// the value, which must outlive it.
struct HdTrapezeNumbers {
    /// TRZ_NUMBERS_*.
    uint32_t type = 0;
    /// Numbers of one element.
    uint32_t width = 0;
    void const* data = nullptr;
    /// Elements.
    size_t count = 0;

    /// False where the value holds no numbers.
    static bool View(VtValue const& value, HdTrapezeNumbers* out);
};

/// Arrays at several times, as the C ABI takes them. T is made of numbers of the type N and nothing
/// else.
template <class T, class N> class HdTrapezeArrays final {
public:
    HdTrapezeArrays() = default;

    /// Of other precisions, too; samples that hold something else are left out. With indices, the
    /// elements that they name; those that are none leave fewer: the renderer says so.
    explicit HdTrapezeArrays(HdTrapezeSamples<VtValue> const& samples,
                             VtIntArray const& indices = {})
        : _samples(HdTrapezeCast<VtArray<T>>(samples)) {
        for (VtArray<T>& array : _samples.values) {
            if (!indices.empty()) {
                VtArray<T> chosen;
                for (int index : indices) {
                    if (index >= 0 && static_cast<size_t>(index) < array.size()) {
                        chosen.push_back(array.cdata()[index]);
                    }
                }
                array = std::move(chosen);
            }
            _values.push_back(reinterpret_cast<N const*>(array.cdata()));
            _counts.push_back(array.size());
        }
    }

    /// As trz_float_samples or trz_matrix_samples.
    template <class Samples> Samples View() const {
        return {_samples.times.data(), _samples.times.size(), _values.data(), _counts.data()};
    }

    bool IsEmpty() const { return _counts.empty(); }

private:
    HdTrapezeSamples<VtArray<T>> _samples;
    std::vector<N const*> _values;
    std::vector<size_t> _counts;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
