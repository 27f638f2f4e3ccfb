#include "selection.h"

#include "hdtrapeze.h"
#include "numbers.h"

#include "pxr/base/gf/half.h"

#include <algorithm>
#include <cstring>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

size_t _SizeOf(uint32_t type) {
    switch (type) {
    case TRZ_NUMBERS_FLOAT64:
    case TRZ_NUMBERS_INT64:
    case TRZ_NUMBERS_UINT64:
        return 8;
    case TRZ_NUMBERS_FLOAT16:
        return 2;
    case TRZ_NUMBERS_UINT8:
        return 1;
    default:
        return 4;
    }
}

} // namespace

HdTrapezeSelection::HdTrapezeSelection(HdTrapezeSamples<VtValue> const& samples,
                                       VtIntArray const& indices, uint32_t width, int elementSize) {
    size_t const each = std::max(elementSize, 1);
    for (size_t i = 0; i < samples.values.size(); ++i) {
        HdTrapezeNumbers numbers;
        if (!HdTrapezeNumbers::View(samples.values[i], &numbers) || !numbers.isArray ||
            (width != 0 && numbers.width != width) ||
            (!_data.empty() && (numbers.type != type || numbers.width != this->width))) {
            continue;
        }
        type = numbers.type;
        this->width = numbers.width;
        size_t const size = _SizeOf(numbers.type) * numbers.width * each;
        std::vector<char> packed(indices.size() * size);
        size_t written = 0;
        for (int index : indices) {
            if (index >= 0 && static_cast<size_t>(index) < numbers.count / each) {
                std::memcpy(packed.data() + written * size,
                            static_cast<char const*>(numbers.data) + index * size, size);
                ++written;
            }
        }
        times.push_back(samples.times[i]);
        counts.push_back(written * each);
        _data.push_back(std::move(packed));
    }
    for (auto const& packed : _data) {
        values.push_back(packed.data());
    }
}

std::vector<std::vector<float>> HdTrapezeSelection::Floats(std::vector<int> const& order) const {
    std::vector<std::vector<float>> all;
    for (size_t i = 0; i < _data.size(); ++i) {
        std::vector<float> floats(counts[i] * width);
        for (size_t k = 0; k < floats.size(); ++k) {
            size_t const from = order.empty() ? k : k / width * width + order[k % width];
            floats[k] = _Float(_data[i].data(), from);
        }
        all.push_back(std::move(floats));
    }
    return all;
}

float HdTrapezeSelection::_Float(void const* data, size_t i) const {
    switch (type) {
    case TRZ_NUMBERS_FLOAT32:
        return static_cast<float const*>(data)[i];
    case TRZ_NUMBERS_FLOAT64:
        return static_cast<float>(static_cast<double const*>(data)[i]);
    case TRZ_NUMBERS_FLOAT16:
        return static_cast<GfHalf const*>(data)[i];
    default:
        return 0.0f;
    }
}

PXR_NAMESPACE_CLOSE_SCOPE
