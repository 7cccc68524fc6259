#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "sphere_profile.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing_support {

/// A profile in a folder of its own: an arm of two links.
class ProfileFixture : public ::testing::Test {
 protected:
  static constexpr const char* kUrdf = R"(<robot name="arm">
<link name="base"><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<link name="upper"><collision><geometry><cylinder radius="0.05" length="0.4"/></geometry></collision></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="2" effort="3"/></joint>
</robot>
)";
  static constexpr const char* kProfile = R"(# an arm
name: arm
urdf: arm.urdf   # beside it
spheres:
  # the foot
  - {link: base, centre_m: [0, 0, 0], radius_m: 0.2}
  - {link: upper, centre_m: [0, 0, 0.1], radius_m: 0.15}
poses: {bent: [0.5]}
)";

  void SetUp() override {
    folder_.write("arm/arm.urdf", kUrdf);
    folder_.write("arm/profile.yaml", kProfile);
    context_.robot_paths = {folder_.path()};
  }
  Result<SphereProfile> open(const std::string& name = "arm",
                             const std::optional<std::filesystem::path>& out = {}) {
    return SphereProfile::open(name, out, context_);
  }
  [[nodiscard]] std::string text() const {
    std::ifstream in(folder_.path() / "arm/profile.yaml", std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// Files beside the profile, it included.
  [[nodiscard]] std::ptrdiff_t entries() const {
    return std::distance(std::filesystem::directory_iterator(folder_.path() / "arm"), {});
  }

  TemporaryFolder folder_;
  conformance::TestHost host_{1, {.documents = std::make_shared<YamlDocumentReader>()}};
  HostContext context_ = host_.context();
};

}  // namespace sidestep::testing_support
