#include "conformance/source_conformance.hpp"
#include "conformance/test_host.hpp"
#include "pcd_source.hpp"
#include "pcd_testing.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::conformance {
namespace {

/// Clouds 0.pcd and on, each of two walls that meet, from half a metre further along x.
void write_clouds(const testing_support::TemporaryFolder& folder, int clouds) {
  for (int n = 0; n < clouds; ++n) {
    pcd::testing::Points points{{std::nanf(""), 0.0F, 1.0F}};
    for (int i = 0; i < 400; ++i) {
      const auto u = static_cast<float>(i % 20), v = static_cast<float>(i / 20);
      points.emplace_back(0.1F * u, 0.1F * v, 2.0F + 0.01F * static_cast<float>(n));
      points.emplace_back(1.9F, 0.1F * v, 0.1F * u);
    }
    const std::string viewpoint = std::to_string(0.5 * n) + " 0 0 0.8 0 0.6 0";
    folder.write(std::to_string(n) + ".pcd", pcd::testing::ascii_pcd(points, viewpoint));
  }
}

using Change =
    std::function<void(const testing_support::TemporaryFolder& folder, pcd::Options& options)>;

SourceCase clouds(const std::string& name, const Change& change) {
  struct Parts {
    testing_support::TemporaryFolder folder;
    conformance::RecordingLog log;
    std::unique_ptr<Source> source;
  };
  return {name, [change](const Clock&) {
            auto parts = std::make_shared<Parts>();
            write_clouds(parts->folder, 5);
            pcd::Options options;
            options.path = parts->folder.path();
            change(parts->folder, options);
            auto source = pcd::create_source(options, 7, parts->log);
            if (!source) throw std::runtime_error(source.error().describe());
            parts->source = std::move(*source);
            return std::shared_ptr<Source>(parts, parts->source.get());
          }};
}

void filter(const testing_support::TemporaryFolder&, pcd::Options& options) {
  options.points_in = "forward";
  options.filters.resize(3);
  options.filters[0].plane = pcd::PlaneFilter{};
  options.filters[1].voxel = pcd::VoxelFilter{0.05};
  options.filters[2].outlier = pcd::OutlierFilter{};
}

void match_poses(const testing_support::TemporaryFolder& folder, pcd::Options& options) {
  options.match = "stamp";
  options.points_in = "world";
  options.max_pose_offset_s = 0.2;
  options.poses = folder.write(
      "poses.txt", "3.1 2 0 0 0 0 0.6 0.8\n0 0 0 0 0 0 0 1\n1 0 1 0 0 0 0 1\n4 0 1 0 0 0 0 1\n");
}

void damage(const testing_support::TemporaryFolder& folder, pcd::Options&) {
  folder.write("1.pcd", "# .PCD v0.7\nVERSION 0.7\nFIELDS x y\n");
}

INSTANTIATE_TEST_SUITE_P(Pcd, SourceConformance,
                         testing::Values(clouds("viewpoints", [](const auto&, auto&) {}),
                                         clouds("filtered", filter),
                                         clouds("poses_by_stamp", match_poses),
                                         clouds("with_a_damaged_cloud", damage)),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
