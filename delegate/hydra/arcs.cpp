#include "arcs.h"

#include "pxr/base/gf/range3d.h"
#include "pxr/imaging/hd/renderIndex.h"
#include "pxr/imaging/hd/sceneIndex.h"
#include "pxr/imaging/hd/tokens.h"
#include "pxr/imaging/hd/xformSchema.h"

#include <deque>
#include <map>
#include <set>

PXR_NAMESPACE_OPEN_SCOPE

namespace {

// As in `hdtrapeze record`: the largest distance of a path from the line between samples, relative
// to the size of the linear part; for the translation relative to the larger of that and the path's
// extent.
constexpr double _tolerance = 2.5e-4;
// Samples at most: a full turn keeps to a radius of 500 pixels within 0.6 pixels.
constexpr size_t _mostSamples = 64;

// A transform at any time.
class _Path {
public:
    explicit _Path(HdMatrixDataSourceHandle const& source) : _source(source) {}

    GfMatrix4d const& At(float time) {
        auto const found = _known.find(time);
        return found != _known.end()
                   ? found->second
                   : _known.emplace(time, _source->GetTypedValue(time)).first->second;
    }

    bool IsFinite() const {
        for (auto const& [time, matrix] : _known) {
            for (int i = 0; i < 16; ++i) {
                if (!std::isfinite(matrix.data()[i])) {
                    return false;
                }
            }
        }
        return true;
    }

    // Allows the tolerance as measured by what is known of the path.
    void SetLimits() {
        double linear = 0.0;
        GfRange3d reach;
        for (auto const& [time, matrix] : _known) {
            for (int i = 0; i < 12; ++i) {
                linear = std::max(linear, i % 4 < 3 ? std::abs(matrix.data()[i]) : 0.0);
            }
            reach.UnionWith(matrix.ExtractTranslation());
        }
        GfVec3d const size = reach.GetSize();
        _linear = _tolerance * linear;
        _translation = _tolerance * std::max({linear, size[0], size[1], size[2]});
    }

    // Whether the path at `time` is off the line from `a` to `b`.
    bool Misses(float a, float b, float time) {
        double const part = (static_cast<double>(time) - a) / (static_cast<double>(b) - a);
        GfMatrix4d const line = At(a) * (1.0 - part) + At(b) * part;
        GfMatrix4d const off = At(time) - line;
        for (int i = 0; i < 16; ++i) {
            if (i % 4 < 3 && std::abs(off.data()[i]) > (i < 12 ? _linear : _translation)) {
                return true;
            }
        }
        return false;
    }

    // Whether the value is held next to one of its ends: not a path, but samples of one.
    bool IsHeld(float a, float b) {
        GfMatrix4d const& first = At(a);
        GfMatrix4d const& last = At(b);
        return first != last &&
               (At(a + (b - a) * 0.25f) == first || At(a + (b - a) * 0.75f) == last);
    }

private:
    HdMatrixDataSourceHandle _source;
    std::map<float, GfMatrix4d> _known;
    double _linear = 0.0;
    double _translation = 0.0;
};

struct _Segment {
    float first;
    float last;
    // Where it is compared with the line.
    std::vector<float> probes;

    float Middle() const { return first + (last - first) * 0.5f; }
};

HdMatrixDataSourceHandle _Find(HdSceneDelegate* delegate, SdfPath const& id) {
    HdSceneIndexBaseRefPtr const scene = delegate->GetRenderIndex().GetTerminalSceneIndex();
    HdContainerDataSourceHandle const prim = scene ? scene->GetPrim(id).dataSource : nullptr;
    if (!prim || prim->Get(HdSceneIndexEmulationTokens->sceneDelegate)) {
        return nullptr;
    }
    return HdXformSchema::GetFromParent(prim).GetMatrix();
}

} // namespace

bool HdTrapezeAddArcs(HdSceneDelegate* delegate, SdfPath const& id, GfInterval const& shutter,
                      HdTrapezeSamples<GfMatrix4d>* samples) {
    if (samples->times.size() < 2 || shutter.GetSize() == 0.0) {
        return false;
    }
    HdMatrixDataSourceHandle const source = _Find(delegate, id);
    if (!source) {
        return false;
    }
    float const open = static_cast<float>(shutter.GetMin());
    float const close = static_cast<float>(shutter.GetMax());
    std::set<float> times = {open, close};
    for (double time : samples->times) {
        if (open < time && time < close) {
            times.insert(static_cast<float>(time));
        }
    }
    // A path may cross the line in the middle, so each segment is first compared at its quarters.
    _Path path(source);
    std::deque<_Segment> pending;
    for (auto first = times.begin(), last = std::next(first); last != times.end();
         ++first, ++last) {
        float const size = *last - *first;
        pending.push_back(
            {*first, *last, {*first + size * 0.25f, *first + size * 0.5f, *first + size * 0.75f}});
        if (path.IsHeld(*first, *last)) {
            return false;
        }
        path.At(pending.back().Middle());
    }
    if (!path.IsFinite()) {
        return false; // the renderer warns
    }
    path.SetLimits();
    while (!pending.empty() && times.size() < _mostSamples) {
        _Segment const segment = pending.front();
        pending.pop_front();
        float const middle = segment.Middle();
        auto const misses = [&](float time) {
            return path.Misses(segment.first, segment.last, time);
        };
        if (segment.first < middle && middle < segment.last &&
            std::any_of(segment.probes.begin(), segment.probes.end(), misses)) {
            times.insert(middle);
            for (auto const& [a, b] :
                 {std::pair(segment.first, middle), std::pair(middle, segment.last)}) {
                pending.push_back({a, b, {}});
                pending.back().probes = {pending.back().Middle()};
            }
        }
    }
    samples->times.assign(times.begin(), times.end());
    samples->values.clear();
    for (float time : times) {
        samples->values.push_back(path.At(time));
    }
    return true;
}

PXR_NAMESPACE_CLOSE_SCOPE
