#include <cmath>
#include <cstdlib>
#include <fstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

constexpr const char* kJoints =
    "panda_joint1,panda_joint2,panda_joint3,panda_joint4,panda_joint5,panda_joint6,panda_joint7";

class CertifyCommand : public ::testing::Test {
 protected:
  CertifyCommand() {
    folder_.write(
        "scene.yaml",
        "objects:\n  - {name: post, shape: {cylinder: {radius_m: 0.05, length_m: 0.8}}, pose: "
        "{xyz_m: [0.5, 0.5, 0.4]}}\n");
  }
  [[nodiscard]] Finished certify(const std::string& rows,
                                 const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{
        "certify",
        folder_.write("motion.csv", "time_s," + std::string(kJoints) + "\n" + rows).string(),
        "--robot",
        "panda",
        "--scene",
        (folder_.path() / "scene.yaml").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  testing_support::TemporaryFolder folder_;
};

TEST_F(CertifyCommand, LeavesACertificateThatIsAccepted) {
  const std::string file = (folder_.path() / "proof.json").string();
  const Finished done =
      certify("0,0,-0.785,0,-2.356,0,1.571,0.785\n2,-1,-0.3,0,-2,0,1.571,0.785\n", {"--out", file});
  EXPECT_EQ(done.exit_code, 0) << done.error;
  EXPECT_THAT(
      done.out,
      HasSubstr("proven: more than 0 m clear over all of its time, limits held (joined: linear"));
  EXPECT_EQ(std::system((std::string(RECHECK) + " " + file + " > /dev/null").c_str()), 0);
}

TEST_F(CertifyCommand, NamesWhereItCollides) {
  const std::string file = (folder_.path() / "proof.json").string();
  const Finished done = certify("0,0,0.2,0,-1.8,0,1.8,0.785\n2,1.5,0.2,0,-1.8,0,1.8,0.785\n",
                                {"--json", "--out", file});
  EXPECT_EQ(done.exit_code, 1) << done.error;
  const Json json = Json::parse(done.out);
  EXPECT_EQ(json["verdict"], "refuted");
  EXPECT_EQ(json["witness"]["b"], "post");
  const double x = json["witness"]["p_b_m"][0], y = json["witness"]["p_b_m"][1];
  EXPECT_LE(std::hypot(x - 0.5, y - 0.5), 0.05 + 1e-6);  // it is in the post
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST_F(CertifyCommand, NamesWhatIsWrong) {
  const Finished jumps = certify("0,0,0,0,-1,0,1,0\n0,1,0,0,-1,0,1,0\n");
  EXPECT_EQ(jumps.exit_code, 2);
  EXPECT_THAT(jumps.error, HasSubstr("motion.csv:3: time does not go on"));
  const Finished fast = certify("0,0,0,0,-1,0,1,0\n0.01,1,0,0,-1,0,1,0\n");
  EXPECT_EQ(fast.exit_code, 1);
  EXPECT_THAT(fast.out, HasSubstr("refuted: panda_joint1 breaks its velocity limit at"));
}

}  // namespace
}  // namespace sidestep::testing
