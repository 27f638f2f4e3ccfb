// The C++ half of the bridge: thin classes over OpenSubdiv's Far::TopologyRefiner and Bfr::Surface.
// See bridge.rs for what each function promises.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <opensubdiv/bfr/refinerSurfaceFactory.h>
#include <opensubdiv/bfr/surface.h>
#include <opensubdiv/bfr/surfaceFactoryCache.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefiner.h>

#include "rust/cxx.h"

namespace hdtrapeze::osd {

struct MeshSpec;
struct PatchInfo;
class PatchCache;

class Mesh {
public:
    Mesh(std::unique_ptr<OpenSubdiv::Far::TopologyRefiner> refiner,
         std::shared_ptr<PatchCache> cache);
    ~Mesh();
    bool has_limit(std::int32_t face) const;

    OpenSubdiv::Bfr::RefinerSurfaceFactoryBase const& factory() const { return *factory_; }
    bool is_quad_scheme() const;

private:
    std::unique_ptr<OpenSubdiv::Far::TopologyRefiner> refiner_;
    std::shared_ptr<PatchCache> cache_;
    std::unique_ptr<OpenSubdiv::Bfr::RefinerSurfaceFactoryBase> factory_;
};

class Patch {
public:
    PatchInfo bind(Mesh const& mesh, std::int32_t face, std::int32_t channel,
                   rust::Slice<float const> values, std::size_t size);
    rust::Slice<float const> signature() const;
    rust::Slice<float const> points() const;
    void complete();
    void evaluate(rust::Slice<float const> uv, bool derivatives);
    rust::Slice<float const> position() const;
    rust::Slice<float const> du() const;
    rust::Slice<float const> dv() const;

private:
    OpenSubdiv::Bfr::Surface<float> surface_;
    std::size_t size_ = 0;
    std::vector<float> signature_, points_, position_, du_, dv_;
};

class Weights {
public:
    Weights(Mesh const& mesh, std::int32_t face, std::int32_t channel);
    rust::Slice<double const> at(double u, double v);
    rust::Slice<double const> stencils();

private:
    OpenSubdiv::Bfr::Surface<double> surface_;
    std::vector<double> units_, result_, stencils_;
};

std::int32_t library_version();
std::shared_ptr<PatchCache> make_cache();
std::shared_ptr<Mesh> make_mesh(MeshSpec const& spec, std::shared_ptr<PatchCache> cache);
std::unique_ptr<Patch> make_patch();
std::unique_ptr<Weights> make_weights(Mesh const& mesh, std::int32_t face, std::int32_t channel);
std::array<float, 2> sub_face_origin(std::int32_t face_size, std::int32_t i);

} // namespace hdtrapeze::osd
