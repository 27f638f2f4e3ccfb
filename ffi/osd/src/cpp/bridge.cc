#include "hdtrapeze-osd/src/cpp/bridge.h"

#include <algorithm>
#include <mutex>
#include <shared_mutex>
#include <stdexcept>

#include "hdtrapeze-osd/src/bridge.rs.h"

namespace hdtrapeze::osd {

namespace Bfr = OpenSubdiv::Bfr;
namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

namespace {

// How often extraordinary vertices are isolated before the limit is approximated by a Gregory
// patch. On a cube of size 2, the worst case, the surface is then 0.0017 off; with the library's
// own 2, 0.010, with 3, 0.0039, with 5, 0.0005.
constexpr int smooth_level = 4;

// The topology that the surface factory looked up last on this thread.
thread_local std::uint64_t last_key = 0;

using ThreadedCache =
    Bfr::SurfaceFactoryCacheThreaded<std::shared_mutex, std::shared_lock<std::shared_mutex>,
                                     std::unique_lock<std::shared_mutex>>;

// A factory whose only cache is the external one of its options.
class Factory : public Bfr::RefinerSurfaceFactoryBase {
public:
    using Bfr::RefinerSurfaceFactoryBase::RefinerSurfaceFactoryBase;
};

template <typename REAL>
bool init_surface(Mesh const& mesh, std::int32_t face, std::int32_t channel,
                  Bfr::Surface<REAL>* surface) {
    auto const& factory = mesh.factory();
    if (face < 0 || face >= factory.GetNumFaces()) {
        return false;
    }
    return channel < 0 ? factory.InitVertexSurface(face, surface)
                       : factory.InitFaceVaryingSurface(face, surface, channel);
}

// Control points that a regular quad patch does not depend on tell which of its sides are
// boundaries: their weights are zero inside.
std::uint8_t boundary_mask(Bfr::Surface<float> const& surface) {
    float const centre[2] = {0.5f, 0.5f};
    float w[16];
    surface.EvaluateStencil(centre, w);
    auto zero = [&](int a, int b, int c, int d) {
        return w[a] == 0 && w[b] == 0 && w[c] == 0 && w[d] == 0;
    };
    return static_cast<std::uint8_t>((zero(0, 1, 2, 3) ? 1 : 0) | (zero(3, 7, 11, 15) ? 2 : 0) |
                                     (zero(12, 13, 14, 15) ? 4 : 0) | (zero(0, 4, 8, 12) ? 8 : 0));
}

} // namespace

// Remembers the key of the last look-up, which names the irregular topology of a surface.
class PatchCache : public ThreadedCache {
protected:
    DataType Find(KeyType const& key) const override {
        last_key = key;
        return ThreadedCache::Find(key);
    }
};

std::int32_t library_version() { return OPENSUBDIV_VERSION_NUMBER; }

std::shared_ptr<PatchCache> make_cache() { return std::make_shared<PatchCache>(); }

Mesh::Mesh(std::unique_ptr<Far::TopologyRefiner> refiner, std::shared_ptr<PatchCache> cache)
    : refiner_(std::move(refiner)), cache_(std::move(cache)) {
    Bfr::SurfaceFactory::Options options;
    options.SetExternalCache(cache_.get());
    options.SetApproxLevelSmooth(smooth_level);
    factory_ = std::make_unique<Factory>(*refiner_, options);
}

Mesh::~Mesh() = default;

bool Mesh::has_limit(std::int32_t face) const { return factory_->FaceHasLimitSurface(face); }

bool Mesh::is_quad_scheme() const { return refiner_->GetSchemeType() != Sdc::SCHEME_LOOP; }

std::shared_ptr<Mesh> make_mesh(MeshSpec const& spec, std::shared_ptr<PatchCache> cache) {
    Far::TopologyDescriptor desc;
    desc.numVertices = spec.vertex_count;
    desc.numFaces = static_cast<int>(spec.counts.size());
    desc.numVertsPerFace = spec.counts.data();
    desc.vertIndicesPerFace = spec.indices.data();
    desc.numCreases = static_cast<int>(spec.crease_sharpness.size());
    desc.creaseVertexIndexPairs = spec.crease_pairs.data();
    desc.creaseWeights = spec.crease_sharpness.data();
    desc.numCorners = static_cast<int>(spec.corners.size());
    desc.cornerVertexIndices = spec.corners.data();
    desc.cornerWeights = spec.corner_sharpness.data();
    desc.numHoles = static_cast<int>(spec.holes.size());
    desc.holeIndices = spec.holes.data();

    std::vector<Far::TopologyDescriptor::FVarChannel> channels(spec.channel_value_counts.size());
    for (std::size_t i = 0; i < channels.size(); ++i) {
        channels[i].numValues = spec.channel_value_counts[i];
        channels[i].valueIndices = spec.channel_indices.data() + i * spec.indices.size();
    }
    desc.numFVarChannels = static_cast<int>(channels.size());
    desc.fvarChannels = channels.data();

    static Sdc::Options::VtxBoundaryInterpolation const boundaries[] = {
        Sdc::Options::VTX_BOUNDARY_NONE, Sdc::Options::VTX_BOUNDARY_EDGE_ONLY,
        Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER};
    static Sdc::Options::FVarLinearInterpolation const face_varying[] = {
        Sdc::Options::FVAR_LINEAR_NONE,          Sdc::Options::FVAR_LINEAR_CORNERS_ONLY,
        Sdc::Options::FVAR_LINEAR_CORNERS_PLUS1, Sdc::Options::FVAR_LINEAR_CORNERS_PLUS2,
        Sdc::Options::FVAR_LINEAR_BOUNDARIES,    Sdc::Options::FVAR_LINEAR_ALL};
    static Sdc::SchemeType const schemes[] = {Sdc::SCHEME_BILINEAR, Sdc::SCHEME_CATMARK,
                                              Sdc::SCHEME_LOOP};
    if (spec.scheme > 2 || spec.boundary > 2 || spec.face_varying > 5) {
        throw std::invalid_argument("unknown subdivision option");
    }
    Sdc::Options options;
    options.SetVtxBoundaryInterpolation(boundaries[spec.boundary]);
    options.SetFVarLinearInterpolation(face_varying[spec.face_varying]);
    options.SetTriangleSubdivision(spec.smooth_triangles ? Sdc::Options::TRI_SUB_SMOOTH
                                                         : Sdc::Options::TRI_SUB_CATMARK);

    using RefinerFactory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
    std::unique_ptr<Far::TopologyRefiner> refiner(
        RefinerFactory::Create(desc, RefinerFactory::Options(schemes[spec.scheme], options)));
    if (!refiner) {
        throw std::runtime_error("OpenSubdiv refuses the topology");
    }
    return std::make_shared<Mesh>(std::move(refiner), std::move(cache));
}

std::unique_ptr<Patch> make_patch() { return std::make_unique<Patch>(); }

PatchInfo Patch::bind(Mesh const& mesh, std::int32_t face, std::int32_t channel,
                      rust::Slice<float const> values, std::size_t size) {
    PatchInfo info{};
    last_key = 0;
    size_ = size;
    signature_.clear();
    if (!init_surface(mesh, face, channel, &surface_)) {
        points_.clear();
        return info;
    }
    info.valid = true;
    info.regular = surface_.IsRegular();
    info.linear = surface_.IsLinear();
    info.key = info.regular || info.linear ? 0 : last_key;
    info.face_size = surface_.GetFaceSize();
    info.control_count = surface_.GetNumControlPoints();
    info.point_count = surface_.GetNumPatchPoints();
    if (info.regular && !info.linear) {
        if (mesh.is_quad_scheme()) {
            info.mask = boundary_mask(surface_);
        } else {
            float const inside[2] = {0.29f, 0.43f};
            signature_.resize(12);
            surface_.EvaluateStencil(inside, signature_.data());
        }
    }
    Bfr::Surface<float>::PointDescriptor const layout(static_cast<int>(size));
    points_.resize(static_cast<std::size_t>(info.point_count) * size);
    surface_.GatherControlPoints(values.data(), layout, points_.data(), layout);
    return info;
}

void Patch::complete() {
    Bfr::Surface<float>::PointDescriptor const layout(static_cast<int>(size_));
    surface_.ComputePatchPoints(points_.data(), layout);
}

rust::Slice<float const> Patch::signature() const { return {signature_.data(), signature_.size()}; }

rust::Slice<float const> Patch::points() const { return {points_.data(), points_.size()}; }

void Patch::evaluate(rust::Slice<float const> uv, bool derivatives) {
    std::size_t const count = uv.size() / 2;
    position_.resize(count * size_);
    if (derivatives) {
        du_.resize(count * size_);
        dv_.resize(count * size_);
    }
    if (!surface_.IsValid()) {
        return;
    }
    Bfr::Surface<float>::PointDescriptor const layout(static_cast<int>(size_));
    for (std::size_t i = 0; i < count; ++i) {
        float const* at = uv.data() + 2 * i;
        if (derivatives) {
            surface_.Evaluate(at, points_.data(), layout, position_.data() + i * size_,
                              du_.data() + i * size_, dv_.data() + i * size_);
        } else {
            surface_.Evaluate(at, points_.data(), layout, position_.data() + i * size_);
        }
    }
}

rust::Slice<float const> Patch::position() const { return {position_.data(), position_.size()}; }
rust::Slice<float const> Patch::du() const { return {du_.data(), du_.size()}; }
rust::Slice<float const> Patch::dv() const { return {dv_.data(), dv_.size()}; }

Weights::Weights(Mesh const& mesh, std::int32_t face, std::int32_t channel) {
    if (!init_surface(mesh, face, channel, &surface_)) {
        throw std::runtime_error("the face has no limit surface");
    }
    auto const n = static_cast<std::size_t>(surface_.GetNumPatchPoints());
    // A single 1 among zeros: read from i on, it is row i of the identity, back to front.
    units_.assign(n == 0 ? 0 : 2 * n - 1, 0.0);
    if (n != 0) {
        units_[n - 1] = 1.0;
    }
    result_.resize(n);
}

rust::Slice<double const> Weights::at(double u, double v) {
    double const uv[2] = {u, v};
    // Points that are one number apart and n numbers long.
    Bfr::Surface<double>::PointDescriptor const rows(static_cast<int>(result_.size()), 1);
    surface_.Evaluate(uv, units_.data(), rows, result_.data());
    std::reverse(result_.begin(), result_.end());
    return {result_.data(), result_.size()};
}

rust::Slice<double const> Weights::stencils() {
    auto const m = static_cast<std::size_t>(surface_.GetNumControlPoints());
    stencils_.assign(result_.size() * m, 0.0);
    for (std::size_t i = 0; i < m; ++i) {
        stencils_[i * m + i] = 1.0;
    }
    surface_.ComputePatchPoints(stencils_.data(), static_cast<int>(m));
    return {stencils_.data(), stencils_.size()};
}

std::unique_ptr<Weights> make_weights(Mesh const& mesh, std::int32_t face, std::int32_t channel) {
    return std::make_unique<Weights>(mesh, face, channel);
}

std::array<float, 2> sub_face_origin(std::int32_t face_size, std::int32_t i) {
    std::array<float, 2> uv{0.0f, 0.0f};
    float const corner[2] = {0.0f, 0.0f};
    Bfr::Parameterization const param(Sdc::SCHEME_CATMARK, face_size);
    if (param.HasSubFaces()) {
        param.ConvertNormalizedSubFaceToCoord(i, corner, uv.data());
    }
    return uv;
}

} // namespace hdtrapeze::osd
