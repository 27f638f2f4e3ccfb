#ifndef HDTRAPEZE_SELECTION_H
#define HDTRAPEZE_SELECTION_H

#include "samples.h"

#include "pxr/base/vt/array.h"
#include "pxr/base/vt/value.h"
#include "pxr/pxr.h"

#include <cstddef>
#include <cstdint>
#include <vector>

PXR_NAMESPACE_OPEN_SCOPE

/// Some elements of arrays of numbers at several times, by their indices: packed one after the
/// other, as the C ABI takes them.
class HdTrapezeSelection final {
public:
    HdTrapezeSelection() = default;

    /// An element is so many values. Indices that are none of a sample are left out of it, so that
    /// it keeps fewer values: the renderer says so. `width` 0 takes numbers of any width.
    HdTrapezeSelection(HdTrapezeSamples<VtValue> const& samples, VtIntArray const& indices,
                       uint32_t width = 0, int elementSize = 1);

    /// As floats, whatever the type was; with the elements' numbers in another order where one is
    /// given.
    std::vector<std::vector<float>> Floats(std::vector<int> const& order = {}) const;

    /// TRZ_NUMBERS_*.
    uint32_t type = 0;
    uint32_t width = 0;
    std::vector<double> times;
    /// Of values, at each time.
    std::vector<size_t> counts;
    std::vector<void const*> values;

private:
    float _Float(void const* data, size_t i) const;

    std::vector<std::vector<char>> _data;
};

PXR_NAMESPACE_CLOSE_SCOPE

#endif
