#ifndef HDTRAPEZE_NUMBERS_H
#define HDTRAPEZE_NUMBERS_H

#include "hdtrapeze.h"
#include "samples.h"

#include "pxr/base/vt/array.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"

#include <cstddef>
#include <cstdint>
#include <list>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

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
    bool isArray = false;

    /// False where the value holds no numbers.
    static bool View(VtValue const& value, HdTrapezeNumbers* out);
};

/// An array as the C ABI takes it. Points into it.
template <class T> void HdTrapezeView(VtArray<T> const& array, T const** first, size_t* count) {
    *first = array.cdata();
    *count = array.size();
}

/// Arrays of floats at several times, as the C ABI takes them. Points into the values, which must
/// outlive it, where they are floats.
class HdTrapezeFloatSamples final {
public:
    /// Elements of `width` numbers; samples that hold something else are left out. With indices,
    /// the elements that they name; those that are none leave fewer: the renderer says so.
    HdTrapezeFloatSamples(HdTrapezeSamples<VtValue> const& samples, uint32_t width,
                          VtIntArray const& indices = {});

    trz_float_samples View() const {
        return {_times.data(), _times.size(), _values.data(), _counts.data()};
    }

    bool IsEmpty() const { return _times.empty(); }

private:
    std::vector<double> _times;
    std::vector<float const*> _values;
    std::vector<size_t> _counts;
    std::list<std::vector<float>> _converted;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
