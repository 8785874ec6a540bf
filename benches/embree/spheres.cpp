// Spheres in Embree 3: what Tyndall's times are compared with.
//
// Takes the centers (an NPY file of float32, N x 3, in C order) and the radius that all spheres have. Builds Embree's own
// geometry of spheres, RTC_GEOMETRY_TYPE_SPHERE_POINT, and renders the pictures of `tyndall bench`: 800 x 800 pixels,
// orthographic and in perspective, shaded by the cosine between ray and normal; 1 and 16 samples a pixel, then 16 with one
// ray of ambient occlusion from each point that was met. Each with single rays and with packets of 4 x 4 pixels. At last
// single rays that share nothing: from random points around the cube to random points in it.
//
// Prints lines of name, tab, value: seconds, bytes, rays a second, shares of rays. With PICTURE, pictures go to PICTURE-*.pgm.
//
//     g++ -O3 -march=native -std=c++17 spheres.cpp -o spheres -lembree3 -lpthread
//     ./spheres CENTERS.npy RADIUS THREADS [PICTURE]

#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <iostream>
#include <thread>

#include "input.h"
#include "view.h"

namespace {

// Edges in pixels: of the picture, of what a thread takes at once, of what a packet covers.
constexpr int kEdge = 800, kTile = 16, kQuad = 4;
constexpr int kLanes = kQuad * kQuad;
constexpr float kFar = 1e30f;
// How far above a surface its light rays start, in radii: beyond the rounding of where the surface is.
constexpr float kLift = 0.02f;
// The caller repeats the whole program; only the short pictures are repeated here.
constexpr int kSamples = 16, kRunsOfOneSample = 5;
constexpr int kLooseRays = 1 << 20, kLooseRaysAtOnce = 1 << 12;

enum class Rays { kSingle, kPackets };

struct Look {
    Rays rays;
    int samples;
    bool ambient_occlusion;
};

struct World {
    RTCScene scene;
    float lift;
    int threads;
};

// How many rays met something, and how many of the points met are occluded.
struct Counts {
    uint64_t met = 0, occluded = 0;
};

double seconds_of(const std::function<void()> &work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

void say(const std::string &name, double value) { std::cout << name << '\t' << value << std::endl; }

// Does `job` for 0 to `count`, whichever thread is free taking the next.
void parallel(int threads, int count, const std::function<void(int)> &job) {
    std::atomic<int> next{0};
    const auto work = [&] {
        // Embree asks for this on every thread.
        _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
        _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
        for (int k; (k = next++) < count;) job(k);
    };
    std::vector<std::thread> others;
    for (int k = 1; k < threads; k++) others.emplace_back(work);
    work();
    for (std::thread &other : others) other.join();
}

RTCIntersectContext context(RTCIntersectContextFlags flags) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = flags;
    return context;
}

RTCRay ray_along(Line line) {
    RTCRay ray{};
    ray.org_x = line.origin.x, ray.org_y = line.origin.y, ray.org_z = line.origin.z;
    ray.dir_x = line.direction.x, ray.dir_y = line.direction.y, ray.dir_z = line.direction.z;
    ray.tfar = kFar;
    ray.mask = ~0u;
    return ray;
}

void set_lane(RTCRay16 &rays, int lane, Line line) {
    rays.org_x[lane] = line.origin.x, rays.org_y[lane] = line.origin.y, rays.org_z[lane] = line.origin.z;
    rays.dir_x[lane] = line.direction.x, rays.dir_y[lane] = line.direction.y, rays.dir_z[lane] = line.direction.z;
    rays.tnear[lane] = rays.time[lane] = 0;
    rays.tfar[lane] = kFar;
    rays.mask[lane] = ~0u;
    rays.id[lane] = rays.flags[lane] = 0;
}

// The ray of a sample: somewhere in its pixel, through the middle if it is the only one.
Line sample_ray(const View &view, const Look &look, int x, int y, Random &random) {
    const bool alone = look.samples == 1;
    const float across = alone ? 0.5f : random.unit(), down = alone ? 0.5f : random.unit();
    return view.through(x + across, y + down);
}

Line light_ray(const World &world, Line line, float t, Vector normal, Random &random) {
    return {line.origin + t * line.direction + world.lift * normal, random.around(normal)};
}

// The light of a sample, with single rays.
float shade(const World &world, const Look &look, Line line, Random &random, Counts &counts) {
    RTCRayHit sought;
    sought.ray = ray_along(line);
    sought.hit.geomID = sought.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext coherent = context(RTC_INTERSECT_CONTEXT_FLAG_COHERENT);
    rtcIntersect1(world.scene, &coherent, &sought);
    if (sought.hit.geomID == RTC_INVALID_GEOMETRY_ID) return 1;
    counts.met++;
    const Vector normal = normalized({sought.hit.Ng_x, sought.hit.Ng_y, sought.hit.Ng_z});
    if (look.ambient_occlusion) {
        RTCRay light = ray_along(light_ray(world, line, sought.ray.tfar, normal, random));
        RTCIntersectContext loose = context(RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
        rtcOccluded1(world.scene, &loose, &light);
        if (light.tfar < 0) {
            counts.occluded++;
            return 0;
        }
    }
    return std::fabs(dot(normal, line.direction));
}

// Adds the light of a sample of each of 4 x 4 pixels to `light`.
void shade_packet(const World &world, const Look &look, const Line lines[kLanes], Random &random, float light[kLanes],
                  Counts &counts) {
    RTCRayHit16 sought;
    RTCRay16 toward_light;
    alignas(64) int all[kLanes], met[kLanes];
    float cosine[kLanes];
    for (int lane = 0; lane < kLanes; lane++) {
        all[lane] = -1;
        set_lane(sought.ray, lane, lines[lane]);
        sought.hit.geomID[lane] = sought.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
    }
    RTCIntersectContext coherent = context(RTC_INTERSECT_CONTEXT_FLAG_COHERENT);
    rtcIntersect16(all, world.scene, &coherent, &sought);
    for (int lane = 0; lane < kLanes; lane++) {
        met[lane] = sought.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID ? 0 : -1;
        cosine[lane] = 1;
        if (!met[lane]) continue;
        counts.met++;
        const Vector normal = normalized({sought.hit.Ng_x[lane], sought.hit.Ng_y[lane], sought.hit.Ng_z[lane]});
        cosine[lane] = std::fabs(dot(normal, lines[lane].direction));
        if (look.ambient_occlusion)
            set_lane(toward_light, lane, light_ray(world, lines[lane], sought.ray.tfar[lane], normal, random));
    }
    if (look.ambient_occlusion) {
        RTCIntersectContext loose = context(RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
        rtcOccluded16(met, world.scene, &loose, &toward_light);
        for (int lane = 0; lane < kLanes; lane++) {
            if (!met[lane] || toward_light.tfar[lane] >= 0) continue;
            counts.occluded++;
            cosine[lane] = 0;
        }
    }
    for (int lane = 0; lane < kLanes; lane++) light[lane] += cosine[lane];
}

// Renders the 4 x 4 pixels whose first is at (x, y).
void render_quad(const World &world, const View &view, const Look &look, int x, int y, std::vector<float> &picture,
                 Counts &counts) {
    Random random(static_cast<uint64_t>(y) * kEdge + x + 1);
    float light[kLanes] = {};
    const auto line = [&](int lane) { return sample_ray(view, look, x + lane % kQuad, y + lane / kQuad, random); };
    if (look.rays == Rays::kPackets) {
        for (int sample = 0; sample < look.samples; sample++) {
            Line lines[kLanes];
            for (int lane = 0; lane < kLanes; lane++) lines[lane] = line(lane);
            shade_packet(world, look, lines, random, light, counts);
        }
    } else {
        for (int lane = 0; lane < kLanes; lane++)
            for (int sample = 0; sample < look.samples; sample++)
                light[lane] += shade(world, look, line(lane), random, counts);
    }
    for (int lane = 0; lane < kLanes; lane++)
        picture[(y + lane / kQuad) * kEdge + x + lane % kQuad] = light[lane] / look.samples;
}

Counts render(const World &world, const View &view, const Look &look, std::vector<float> &picture) {
    constexpr int kTilesAcross = kEdge / kTile;
    std::atomic<uint64_t> met{0}, occluded{0};
    parallel(world.threads, kTilesAcross * kTilesAcross, [&](int tile) {
        Counts counts;
        const int left = tile % kTilesAcross * kTile, top = tile / kTilesAcross * kTile;
        for (int y = top; y < top + kTile; y += kQuad)
            for (int x = left; x < left + kTile; x += kQuad) render_quad(world, view, look, x, y, picture, counts);
        met += counts.met;
        occluded += counts.occluded;
    });
    return {met, occluded};
}

void write_picture(const std::string &path, const std::vector<float> &picture) {
    std::ofstream file(path, std::ios::binary);
    file << "P5\n" << kEdge << ' ' << kEdge << "\n255\n";
    for (const float light : picture) file.put(static_cast<char>(255 * std::min(light, 1.0f)));
}

// All looks from one camera; the name of a measurement says camera, samples, and which rays.
void measure_pictures(const World &world, Projection projection, const std::string &stem) {
    const std::string camera = projection == Projection::kOrthographic ? "orthographic" : "perspective";
    const View view(projection, kEdge);
    std::vector<float> picture(kEdge * kEdge);
    for (const auto &[samples, ambient_occlusion] : {std::pair{1, false}, {kSamples, false}, {kSamples, true}}) {
        for (const Rays rays : {Rays::kSingle, Rays::kPackets}) {
            const Look look{rays, samples, ambient_occlusion};
            const std::string scene = camera + ' ' + std::to_string(samples) + (ambient_occlusion ? "+1" : "");
            Counts counts;
            std::vector<double> times;
            // What the first picture brings into the caches is not measured.
            if (samples == 1) render(world, view, look, picture);
            for (int run = 0; run < (samples == 1 ? kRunsOfOneSample : 1); run++)
                times.push_back(seconds_of([&] { counts = render(world, view, look, picture); }));
            say(scene + (rays == Rays::kSingle ? " single s" : " packets s"), median(times));
            if (rays == Rays::kPackets) continue;
            say(scene + " met", counts.met / (double(kEdge) * kEdge * samples));
            if (ambient_occlusion) say(scene + " occluded", double(counts.occluded) / std::max<uint64_t>(counts.met, 1));
            if (ambient_occlusion && !stem.empty()) write_picture(stem + '-' + camera + ".pgm", picture);
        }
    }
}

// Single rays without order: from the sphere of radius 2 around the cube's middle to points of the cube, both uniform.
void measure_loose_rays(const World &world) {
    std::vector<Line> lines(kLooseRays);
    Random random(1);
    for (Line &line : lines) {
        line.origin = Vector{0.5f, 0.5f, 0.5f} + 2.0f * random.direction();
        const Vector target{random.unit(), random.unit(), random.unit()};
        line.direction = normalized(target - line.origin);
    }
    std::atomic<uint64_t> met{0};
    const double secs = seconds_of([&] {
        parallel(world.threads, kLooseRays / kLooseRaysAtOnce, [&](int job) {
            uint64_t found = 0;
            for (int k = job * kLooseRaysAtOnce; k < (job + 1) * kLooseRaysAtOnce; k++) {
                RTCRayHit sought;
                sought.ray = ray_along(lines[k]);
                sought.hit.geomID = sought.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
                RTCIntersectContext loose = context(RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
                rtcIntersect1(world.scene, &loose, &sought);
                found += sought.hit.geomID != RTC_INVALID_GEOMETRY_ID;
            }
            met += found;
        });
    });
    say("incoherent rays/s", kLooseRays / secs);
    say("incoherent met", double(met) / kLooseRays);
}

void measure(const std::string &path, float radius, int threads, const std::string &stem) {
    const std::vector<Sphere> spheres = spheres_of(path, radius);
    const size_t count = spheres.size();
    const double before = memory_bytes("VmRSS:");

    RTCDevice device = rtcNewDevice(("threads=" + std::to_string(threads)).c_str());
    RTCScene scene = rtcNewScene(device);
    const double build_secs = seconds_of([&] {
        RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, spheres.data(), 0,
                                   sizeof(Sphere), count);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene);
    });
    if (rtcGetDeviceError(device) != RTC_ERROR_NONE) throw std::runtime_error("Embree failed to build");
    say("version", static_cast<double>(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION)));
    say("particles", static_cast<double>(count));
    say("build s", build_secs);
    // The array of spheres is Embree's too: it reads them from there.
    say("B/particle", (memory_bytes("VmRSS:") - before) / count + sizeof(Sphere));
    say("peak bytes", memory_bytes("VmHWM:"));

    const World world{scene, kLift * radius, threads};
    measure_pictures(world, Projection::kOrthographic, stem);
    measure_pictures(world, Projection::kPerspective, stem);
    measure_loose_rays(world);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
}

}  // namespace

int main(int count, char **words) {
    if (count != 4 && count != 5) {
        std::cerr << "usage: spheres CENTERS.npy RADIUS THREADS [PICTURE]\n";
        return 2;
    }
    try {
        std::cout.precision(9);
        measure(words[1], std::stof(words[2]), std::stoi(words[3]), count == 5 ? words[4] : "");
    } catch (const std::exception &error) {
        std::cerr << "error: " << error.what() << '\n';
        return 1;
    }
}
