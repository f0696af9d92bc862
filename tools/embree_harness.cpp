// Embree 3 behind a C interface: scenes, traces over raytide's own ray records, the surface-area cost of its builder.
// Every function returns 0, or Embree's error code. Threads are started for each call; rays go out in chunks.

#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <thread>
#include <vector>

namespace {

struct Ray { float origin[3]; uint32_t skip; float direction[3]; float t_max; };  // raytide's record, 32 bytes
struct Hit { float t, u, v; uint32_t prim; };                                     // 16 bytes

struct Mesh {  // rows of four words, of which the first three count
    const float *vertices;
    const uint32_t *triangles;
    const float *corner(uint32_t triangle, int k) const
    {
        return vertices + 4 * size_t(triangles[4 * size_t(triangle) + k]);
    }
};

struct World {
    RTCDevice device;
    RTCScene scene;
};

constexpr size_t CHUNK = 4096;

void flush_denormals()  // as Embree asks of every thread that traces
{
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
}

template <class Body> void in_chunks(size_t count, int threads, const Body &body)
{
    std::atomic<size_t> next{0};
    auto work = [&] {
        flush_denormals();
        for (size_t begin; (begin = next.fetch_add(CHUNK)) < count;) body(begin, std::min(begin + CHUNK, count));
    };
    std::vector<std::thread> others;
    for (int i = 1; i < threads; i++) others.emplace_back(work);
    const unsigned before = _mm_getcsr();
    work();
    _mm_setcsr(before);
    for (auto &thread : others) thread.join();
}

RTCIntersectContext context_of(bool coherent)
{
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    if (coherent) context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    return context;
}

void closest_1(RTCScene scene, const Ray *rays, Hit *hits, size_t begin, size_t end, bool coherent)
{
    RTCIntersectContext context = context_of(coherent);
    for (size_t i = begin; i < end; i++) {
        const Ray &r = rays[i];
        RTCRayHit q;
        q.ray = {r.origin[0], r.origin[1], r.origin[2], 0.0f, r.direction[0], r.direction[1], r.direction[2],
                 0.0f, r.t_max, 0xffffffffu, 0, 0};
        q.hit.geomID = q.hit.instID[0] = q.hit.primID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, &context, &q);
        hits[i] = {q.ray.tfar, q.hit.u, q.hit.v, q.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 0xffffffffu : q.hit.primID};
    }
}

void any_1(RTCScene scene, const Ray *rays, Hit *hits, size_t begin, size_t end, bool coherent)
{
    RTCIntersectContext context = context_of(coherent);
    for (size_t i = begin; i < end; i++) {
        const Ray &r = rays[i];
        RTCRay q = {r.origin[0], r.origin[1], r.origin[2], 0.0f, r.direction[0], r.direction[1], r.direction[2],
                    0.0f, r.t_max, 0xffffffffu, 0, 0};
        rtcOccluded1(scene, &context, &q);
        hits[i].t = q.tfar;
    }
}

void load_16(const Ray *rays, size_t count, RTCRay16 &q, int *valid)
{
    for (size_t lane = 0; lane < 16; lane++) {
        const Ray &r = rays[lane < count ? lane : 0];
        valid[lane] = lane < count ? -1 : 0;
        q.org_x[lane] = r.origin[0]; q.org_y[lane] = r.origin[1]; q.org_z[lane] = r.origin[2];
        q.dir_x[lane] = r.direction[0]; q.dir_y[lane] = r.direction[1]; q.dir_z[lane] = r.direction[2];
        q.tnear[lane] = 0.0f; q.tfar[lane] = r.t_max; q.time[lane] = 0.0f;
        q.mask[lane] = 0xffffffffu; q.id[lane] = 0; q.flags[lane] = 0;
    }
}

void closest_16(RTCScene scene, const Ray *rays, Hit *hits, size_t begin, size_t end, bool coherent)
{
    RTCIntersectContext context = context_of(coherent);
    alignas(64) RTCRayHit16 q;
    alignas(64) int valid[16];
    for (size_t i = begin; i < end; i += 16) {
        const size_t count = std::min<size_t>(16, end - i);
        load_16(rays + i, count, q.ray, valid);
        for (size_t lane = 0; lane < 16; lane++) {
            q.hit.geomID[lane] = q.hit.instID[0][lane] = q.hit.primID[lane] = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect16(valid, scene, &context, &q);
        for (size_t lane = 0; lane < count; lane++) {
            const bool miss = q.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID;
            hits[i + lane] = {q.ray.tfar[lane], q.hit.u[lane], q.hit.v[lane], miss ? 0xffffffffu : q.hit.primID[lane]};
        }
    }
}

void any_16(RTCScene scene, const Ray *rays, Hit *hits, size_t begin, size_t end, bool coherent)
{
    RTCIntersectContext context = context_of(coherent);
    alignas(64) RTCRay16 q;
    alignas(64) int valid[16];
    for (size_t i = begin; i < end; i += 16) {
        const size_t count = std::min<size_t>(16, end - i);
        load_16(rays + i, count, q, valid);
        rtcOccluded16(valid, scene, &context, &q);
        for (size_t lane = 0; lane < count; lane++) hits[i + lane].t = q.tfar[lane];
    }
}

// Embree's builder with raytide's layout: the tree only exists to be measured. `below` sums the half surfaces of all
// boxes under a node.
struct Node { double below; };

double half_surface(const RTCBounds &b)
{
    const double x = b.upper_x - b.lower_x, y = b.upper_y - b.lower_y, z = b.upper_z - b.lower_z;
    return x * y + y * z + z * x;
}

void *make_node(RTCThreadLocalAllocator allocator, unsigned int, void *)
{
    return new (rtcThreadLocalAlloc(allocator, sizeof(Node), 16)) Node{0.0};
}

void *make_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive *, size_t, void *)
{
    return new (rtcThreadLocalAlloc(allocator, sizeof(Node), 16)) Node{0.0};
}

void set_children(void *node, void **children, unsigned int count, void *)
{
    for (unsigned int i = 0; i < count; i++) {
        static_cast<Node *>(node)->below += static_cast<const Node *>(children[i])->below;
    }
}

void set_bounds(void *node, const RTCBounds **bounds, unsigned int count, void *)
{
    for (unsigned int i = 0; i < count; i++) static_cast<Node *>(node)->below += half_surface(*bounds[i]);
}

constexpr RTCBounds NOTHING = {1e30f, 1e30f, 1e30f, 0, -1e30f, -1e30f, -1e30f, 0};

void extend(RTCBounds &b, const float *point)
{
    for (int axis = 0; axis < 3; axis++) {
        (&b.lower_x)[axis] = std::min((&b.lower_x)[axis], point[axis]);
        (&b.upper_x)[axis] = std::max((&b.upper_x)[axis], point[axis]);
    }
}

// The box of one side of a plane: of the triangle's part there, and within the box that the primitive had.
void split(const RTCBuildPrimitive *primitive, unsigned int axis, float position, RTCBounds *left, RTCBounds *right,
           void *mesh)
{
    *left = *right = NOTHING;
    for (int k = 0; k < 3; k++) {
        const float *a = static_cast<const Mesh *>(mesh)->corner(primitive->primID, k);
        const float *b = static_cast<const Mesh *>(mesh)->corner(primitive->primID, (k + 1) % 3);
        if (a[axis] <= position) extend(*left, a);
        if (a[axis] >= position) extend(*right, a);
        if ((a[axis] < position) != (b[axis] < position) && a[axis] != position && b[axis] != position) {
            const float t = (position - a[axis]) / (b[axis] - a[axis]);
            float cut[3] = {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])};
            cut[axis] = position;
            extend(*left, cut);
            extend(*right, cut);
        }
    }
    for (RTCBounds *side : {left, right}) {
        for (int k = 0; k < 3; k++) {
            (&side->lower_x)[k] = std::max((&side->lower_x)[k], (&primitive->lower_x)[k]);
            (&side->upper_x)[k] = std::min((&side->upper_x)[k], (&primitive->upper_x)[k]);
        }
    }
}

}  // namespace

extern "C" {

int embree_open(int threads, World **out)
{
    char config[64];
    snprintf(config, sizeof config, "threads=%d,start_threads=1", threads);
    *out = new World{rtcNewDevice(config), nullptr};
    return (*out)->device ? 0 : int(rtcGetDeviceError(nullptr));
}

int embree_version(World *world)
{
    return int(rtcGetDeviceProperty(world->device, RTC_DEVICE_PROPERTY_VERSION));
}

// Vertices are rows of four floats, triangles rows of four indices of which the first three count.
int embree_build(World *world, const float *vertices, size_t vertex_count, const uint32_t *triangles,
                 size_t triangle_count, int quality, int robust)
{
    if (world->scene) rtcReleaseScene(world->scene);
    world->scene = rtcNewScene(world->device);
    rtcSetSceneBuildQuality(world->scene, RTCBuildQuality(quality));
    rtcSetSceneFlags(world->scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    RTCGeometry mesh = rtcNewGeometry(world->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetGeometryBuildQuality(mesh, RTCBuildQuality(quality));
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices, 0, 16, vertex_count);
    rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, triangles, 0, 16, triangle_count);
    rtcCommitGeometry(mesh);
    rtcAttachGeometry(world->scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcCommitScene(world->scene);
    return int(rtcGetDeviceError(world->device));
}

// width 1 or 16; any: occlusion, for which only t of a hit is written: minus infinity where something was met.
int embree_trace(World *world, const Ray *rays, Hit *hits, size_t count, int width, int any, int coherent, int threads)
{
    const auto trace = any ? (width == 16 ? any_16 : any_1) : (width == 16 ? closest_16 : closest_1);
    in_chunks(count, threads, [&](size_t begin, size_t end) {
        trace(world->scene, rays, hits, begin, end, coherent != 0);
    });
    return int(rtcGetDeviceError(world->device));
}

// Sum of the surfaces of all nodes and leaves over the root's, for Embree's builder told to make 8-wide nodes and
// leaves of up to 8: the same measure as raytide's tree statistics.
int embree_cost(World *world, const float *vertices, const uint32_t *triangles, size_t count, int quality, double *cost)
{
    Mesh mesh = {vertices, triangles};
    const size_t room = quality == RTC_BUILD_QUALITY_HIGH ? 2 * count : count;  // spatial splits make more primitives
    std::vector<RTCBuildPrimitive> primitives(room);
    RTCBounds whole = NOTHING;
    for (size_t i = 0; i < count; i++) {
        RTCBounds b = NOTHING;
        for (int k = 0; k < 3; k++) extend(b, mesh.corner(uint32_t(i), k));
        extend(whole, &b.lower_x);
        extend(whole, &b.upper_x);
        primitives[i] = {b.lower_x, b.lower_y, b.lower_z, 0, b.upper_x, b.upper_y, b.upper_z, uint32_t(i)};
    }
    RTCBVH bvh = rtcNewBVH(world->device);
    RTCBuildArguments arguments = rtcDefaultBuildArguments();
    arguments.buildQuality = RTCBuildQuality(quality);
    arguments.maxBranchingFactor = 8;
    arguments.maxDepth = 64;
    arguments.sahBlockSize = 8;
    arguments.minLeafSize = 8;  // the cheapest trees; smaller ones split leaves without need
    arguments.maxLeafSize = 8;
    arguments.traversalCost = 1.0f;
    arguments.intersectionCost = 1.0f;
    arguments.bvh = bvh;
    arguments.primitives = primitives.data();
    arguments.primitiveCount = count;
    arguments.primitiveArrayCapacity = room;
    arguments.createNode = make_node;
    arguments.setNodeChildren = set_children;
    arguments.setNodeBounds = set_bounds;
    arguments.createLeaf = make_leaf;
    arguments.splitPrimitive = split;
    arguments.userPtr = &mesh;
    const Node *root = static_cast<const Node *>(rtcBuildBVH(&arguments));
    if (root) *cost = 1.0 + root->below / half_surface(whole);
    const int error = int(rtcGetDeviceError(world->device));
    rtcReleaseBVH(bvh);
    return error ? error : !root;
}

void embree_close(World *world)
{
    if (world->scene) rtcReleaseScene(world->scene);
    rtcReleaseDevice(world->device);
    delete world;
}
}
