// What a VGA frame costs on its way from a message, beside the copying of its bytes.

#include <cstring>

#include <benchmark/benchmark.h>

#include "../conversions.hpp"

namespace sidestep::ros_messages {
namespace {

DepthImage ramp() {
  DepthImage image{{640, 480, 525.0, 525.0, 319.5, 239.5}, {}};
  for (int i = 0; i < 640 * 480; ++i) image.depth_m.push_back(0.5F + 1e-5F * static_cast<float>(i));
  return image;
}

void read_image(benchmark::State& state, DepthEncoding encoding) {
  const DepthImage image = ramp();
  const Image message = to_image(image, encoding, Stamp{1}, "camera");
  for (auto _ : state) benchmark::DoNotOptimize(depth_image(message, image.camera, {}));
}
BENCHMARK_CAPTURE(read_image, millimetres, DepthEncoding::k16UC1)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(read_image, metres, DepthEncoding::k32FC1)->Unit(benchmark::kMicrosecond);

void read_cloud(benchmark::State& state) {
  PointCloud cloud;
  for (int i = 0; i < 640 * 480; ++i)
    cloud.points_m.emplace_back(0.1F, 0.2F, 1e-5F * static_cast<float>(i));
  const PointCloud2 message = to_point_cloud(cloud, Stamp{1}, "camera");
  for (auto _ : state) benchmark::DoNotOptimize(point_cloud(message));
}
BENCHMARK(read_cloud)->Unit(benchmark::kMicrosecond);

/// The reference: the bytes of the image in metres.
void copy_image(benchmark::State& state) {
  const DepthImage image = ramp();
  for (auto _ : state) {
    std::vector<float> copy(image.depth_m.size());
    std::memcpy(copy.data(), image.depth_m.data(), copy.size() * sizeof(float));
    benchmark::DoNotOptimize(copy);
  }
}
BENCHMARK(copy_image)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep::ros_messages
