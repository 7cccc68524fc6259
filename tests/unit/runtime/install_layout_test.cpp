#include <gtest/gtest.h>

#include <sidestep/runtime/install_layout.hpp>

namespace sidestep {
namespace {

TEST(InstallLayout, FindsThePrefixFromEveryUsualLibraryFolder) {
  for (const char* lib : {"lib", "lib64", "lib/x86_64-linux-gnu"}) {
    const std::filesystem::path prefix = "/opt/lib/sidestep";
    const InstallLayout layout = install_layout_of(prefix / lib / "libsidestep_runtime.so");
    EXPECT_EQ(layout.plugins, prefix / lib / "sidestep/plugins");
    EXPECT_EQ(layout.robots, prefix / "share/sidestep/robots") << lib;
    EXPECT_EQ(layout.configs, prefix / "share/sidestep/configs") << lib;
  }
}

TEST(InstallLayout, FindsTheBuildTreeThatThisTestRunsIn) {
  const InstallLayout layout = install_layout();
  EXPECT_EQ(layout.plugins, std::filesystem::path(BUILD_FOLDER) / "lib/sidestep/plugins");
  EXPECT_TRUE(std::filesystem::equivalent(layout.robots,
                                          std::filesystem::path(SIDESTEP_SOURCE_DIR) / "robots"));
  EXPECT_TRUE(std::filesystem::equivalent(layout.configs,
                                          std::filesystem::path(SIDESTEP_SOURCE_DIR) / "configs"));
}

}  // namespace
}  // namespace sidestep
