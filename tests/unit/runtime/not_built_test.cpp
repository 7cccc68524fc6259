#include <sidestep/runtime/not_built.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/host_fixture.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const NotBuiltPlugin kRosbag{"source", "rosbag", "libroscpp-core-dev libsensor-msgs-dev"};

TEST(NotBuiltPlugins, AreReadFromTheFoldersOfPlugins) {
  const testing_support::TemporaryFolder one;
  const testing_support::TemporaryFolder other;
  one.write("not_built.txt",
            "source rosbag libroscpp-core-dev libsensor-msgs-dev\n\nnonsense\n"
            "mapper voxel_grid_cuda nvidia-cuda-toolkit\n");
  other.write("not_built.txt", "source rosbag libroscpp-core-dev libsensor-msgs-dev\n");
  const NotBuiltPlugin cuda{"mapper", "voxel_grid_cuda", "nvidia-cuda-toolkit"};
  EXPECT_THAT(plugins_not_built({one.path(), other.path(), one.path() / "absent"}),
              ElementsAre(kRosbag, cuda));
  EXPECT_THAT(plugins_not_built({one.path() / "absent"}), IsEmpty());
}

TEST(NotBuiltPlugins, AreNamedWithTheirPackagesWhereAConfigurationWantsThem) {
  const testing_support::TemporaryFolder folder;
  folder.write("not_built.txt", "source rosbag libroscpp-core-dev libsensor-msgs-dev\n");
  testing_support::HostFixture fixture({folder.path()});
  const auto found =
      fixture.host.find(PluginKind::kSource, fixture.block("{plugin: rosbag, path: a.bag}"));
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::kPlugin);
  EXPECT_THAT(found.error().hint,
              AllOf(HasSubstr("'rosbag' was not built"),
                    HasSubstr("apt install libroscpp-core-dev libsensor-msgs-dev`")));
  const auto of_another_kind =
      fixture.host.find(PluginKind::kMapper, fixture.block("{plugin: rosbag}"));
  EXPECT_THAT(of_another_kind.error().hint, IsEmpty());
}

TEST(NotBuiltPlugins, AreNamedWithTheCommandWhereTheyCouldBeBuilt) {
  const testing_support::TemporaryFolder folder;
  folder.write("configured.txt", "robot point\n");
  testing_support::HostFixture fixture({folder.path()});
  const auto found = fixture.host.find(PluginKind::kRobot, fixture.block("{plugin: point}"));
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().hint,
              AllOf(HasSubstr("'point' is not built yet"), HasSubstr("`tools/build.sh`")));
}

}  // namespace
}  // namespace sidestep
