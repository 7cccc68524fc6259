#include "device_checks.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "device_scene.hpp"
#include "transform_checks.hpp"

namespace sidestep::cuda_checks {
namespace {

using edt_cuda::ChangedDistances;
using edt_cuda::DistanceTransform;
using edt_cuda::TransformSettings;
using edt_cuda::checks::Case;
using voxel_grid_cuda::LogOddsMap;
using voxel_grid_cuda::MapChange;

edt_cuda::MakeTransform on_device(int ordinal) {
  return [ordinal](const TransformSettings& settings) {
    return edt_cuda::make_device_transform(settings, ordinal);
  };
}

std::string differing(const ChangedDistances& a, const ChangedDistances& b) {
  if (!std::ranges::equal(a.blocks, b.blocks)) return "other blocks changed than on the host";
  if (!std::ranges::equal(a.near_vox2, b.near_vox2) ||
      !std::ranges::equal(a.far_vox2, b.far_vox2)) {
    return "other distances than on the host";
  }
  return {};
}

std::string differing(const MapChange& a, const MapChange& b) {
  if (!std::ranges::equal(a.blocks, b.blocks)) return "other blocks changed than on the host";
  if (!std::ranges::equal(a.rows, b.rows)) return "other voxels are occupied or known";
  if (a.fates != b.fates) return "other counts than on the host";
  return {};
}

/// Images and clouds by turns, on the device and on the host.
std::string same_maps(int ordinal) {
  const cuda::Extent size{150, 170, 70};
  auto device = voxel_grid_cuda::make_device_map(map_settings(size), ordinal);
  auto host = voxel_grid_cuda::make_host_map(map_settings(size), cuda::HostBackend());
  if (!device || !host) return device ? host.error().message : device.error().message;
  DeviceScene scene(size, 0.03, 320, 240);
  MapChange all;
  for (int frame = 0; frame < 12; ++frame) {
    const auto integrate = [&](LogOddsMap& map) {
      return frame % 3 == 2 ? map.integrate(scene.cloud(frame)) : map.integrate(scene.image(frame));
    };
    const auto tested = integrate(**device);
    const auto expected = integrate(**host);
    const std::string at = "frame " + std::to_string(frame) + ": ";
    if (!tested) return at + tested.error().message;
    if (!expected) return at + expected.error().message;
    if (auto wrong = differing(*tested, *expected); !wrong.empty()) return at + wrong;
    for (std::size_t f = 0; f < all.fates.size(); ++f) all.fates[f] += tested->fates[f];
  }
  const auto tested = (*device)->log_odds();
  const auto expected = (*host)->log_odds();
  if (!tested || !expected || *tested != *expected) return "other log-odds than on the host";
  const auto unmet = std::ranges::find(all.fates, 0u);
  if (unmet == all.fates.end()) return {};
  return "no measurement met fate " + std::to_string(unmet - all.fates.begin());
}

/// The transform of a map where it lies, against that of the same map on the host.
std::string transform_of_map(int ordinal) {
  const cuda::Extent size{150, 170, 70};
  const TransformSettings settings{size, 1024, true};
  auto device_map = voxel_grid_cuda::make_device_map(map_settings(size), ordinal);
  auto host_map = voxel_grid_cuda::make_host_map(map_settings(size), cuda::HostBackend());
  auto device = edt_cuda::make_device_transform(settings, ordinal);
  auto host = edt_cuda::make_host_transform(settings, cuda::HostBackend());
  if (!device_map || !host_map || !device || !host) return "no room";
  DeviceScene scene(size, 0.03, 320, 240);
  std::vector<std::int32_t> blocks(10 * 11 * 5);
  for (std::size_t b = 0; b < blocks.size(); ++b) blocks[b] = static_cast<std::int32_t>(b);
  for (int frame = 0; frame < 6; ++frame) {
    const auto on_device = (*device_map)->integrate(scene.image(frame));
    const auto on_host = (*host_map)->integrate(scene.image(frame));
    if (!on_device || !on_host) return "a frame failed";
    if (frame > 0) blocks.assign(on_device->blocks.begin(), on_device->blocks.end());
    const auto tested = (*device)->update(blocks, (*device_map)->occupancy(), true);
    const auto expected = (*host)->update(blocks, (*host_map)->occupancy(), true);
    if (!tested || !expected) return "a transform failed";
    if (auto wrong = differing(*tested, *expected); !wrong.empty()) return wrong;
  }
  return {};
}

/// The paper's largest grid, and one beyond any count of 65,535.
std::string large_grid(int ordinal, const cuda::Extent& size, std::uint32_t cap) {
  return edt_cuda::checks::check_sequence(on_device(ordinal), {"", size, cap, true, 2, 40});
}

/// More than any device has: an error that says so, and the device is as usable as before.
std::string too_large(int ordinal) {
  const auto made = edt_cuda::make_device_transform({{32000, 32000, 512}, 1024, true}, ordinal);
  if (made) return "a transform of 3 TiB was made";
  if (made.error().code != ErrorCode::kUnsupported) return made.error().message;
  if (made.error().message.find("MiB") == std::string::npos) return "the error names no size";
  return edt_cuda::checks::check_sequence(on_device(ordinal),
                                          {"", {40, 40, 40}, 100, true, 3, 100});
}

std::string no_such_device() {
  const auto made = edt_cuda::make_device_transform({{16, 16, 16}, 100, false}, 4711);
  if (made) return "device 4711 was found";
  return made.error().where.find("4711") == std::string::npos ? "the error names no device" : "";
}

}  // namespace

std::string why_unusable(int ordinal) {
  const auto made = edt_cuda::make_device_transform({{16, 16, 16}, 100, false}, ordinal);
  if (made) return {};
  return made.error().where + ": " + made.error().message +
         (made.error().hint.empty() ? "" : " (" + made.error().hint + ")");
}

std::vector<Check> device_checks(int ordinal) {
  std::vector<Check> all;
  std::vector<Case> cases = edt_cuda::checks::small_cases();
  std::ranges::copy(edt_cuda::checks::large_cases(), std::back_inserter(cases));
  for (const Case& c : cases) {
    all.push_back({"transform " + c.name,
                   [=] { return edt_cuda::checks::check_sequence(on_device(ordinal), c); }});
  }
  all.push_back({"transform 704 x 704 x 128", [=] {
                   return large_grid(ordinal, {704, 704, 128}, 1024);
                 }});
  all.push_back({"transform 1024 x 1024 x 256, no limit", [=] {
                   return large_grid(ordinal, {1024, 1024, 256}, 2'162'688);
                 }});
  all.push_back({"maps as on the host", [=] { return same_maps(ordinal); }});
  all.push_back({"transform of a map on the device", [=] { return transform_of_map(ordinal); }});
  all.push_back({"a grid beyond the device's memory", [=] { return too_large(ordinal); }});
  all.push_back({"no such device", [] { return no_such_device(); }});
  return all;
}

}  // namespace sidestep::cuda_checks
