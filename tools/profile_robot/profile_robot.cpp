#include "profile_robot.hpp"

#include <cstdio>

#include <sidestep/runtime/install_layout.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "load_robot.hpp"

namespace sidestep {
namespace {

class StderrLog final : public Log {
 public:
  void write(LogLevel, std::string_view message) override {
    std::fprintf(stderr, "%.*s\n", static_cast<int>(message.size()), message.data());
  }
};

class NoClock final : public Clock {
 public:
  Stamp now() const noexcept override { return {}; }
};

}  // namespace

Result<ProfileRobot> load_profile_robot(const std::string& profile) {
  StderrLog log;
  const NoClock clock;
  WorkerPool workers(1);
  const YamlDocumentReader documents;
  const HostContext context{log, clock, workers, documents, 0, {install_layout().robots}, {}, {}};
  urdf_robot::Options options;
  options.profile = Node(Node::Scalar{profile, true}, {"command line"});
  auto file = SIDESTEP_TRY(urdf_robot::find_profile(options.profile, context.robot_paths));
  auto tree = SIDESTEP_TRY(urdf_robot::load_robot(options, context));
  return ProfileRobot{std::move(tree), std::move(file)};
}

}  // namespace sidestep
