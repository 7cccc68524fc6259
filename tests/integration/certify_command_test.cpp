#include <array>
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
  // What an earlier motion has left is not this one's.
  const std::string file = folder_.write("proof.json", "{}").string();
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

/// Side by side, in the order in which they are named, whatever the number of threads and the
/// instructions of the processor.
TEST_F(CertifyCommand, TakesManyMotions) {
  const std::string header = "time_s," + std::string(kJoints) + "\n";
  std::vector<std::string> arguments{"certify"};
  for (int k = 0; k < 12; ++k) {
    const std::string end =
        k == 5 ? "1.5,0.2,0,-1.8" : "-" + std::to_string(0.1 * k) + ",-0.3,0,-2";
    const std::string rows =
        header + (k == 5 ? "0,0,0.2,0,-1.8,0,1.8,0.785\n" : "0,0,-0.785,0,-2.356,0,1.571,0.785\n");
    const std::string name = "m" + std::to_string(k) + ".csv";
    arguments.push_back(folder_.write(name, rows + "2," + end + ",0,1.8,0.785\n").string());
  }
  for (const char* more : {"--robot", "panda", "--scene"}) arguments.emplace_back(more);
  arguments.push_back((folder_.path() / "scene.yaml").string());
  std::array<std::string, 2> said;
  for (const int threads : {1, 2}) {
    if (threads == 1) setenv("SIDESTEP_INSTRUCTIONS", "any", 1);
    auto with = arguments;
    const std::string out = (folder_.path() / ("proofs" + std::to_string(threads))).string();
    for (const std::string& more :
         {std::string("--threads"), std::to_string(threads), std::string("--out"), out}) {
      with.push_back(more);
    }
    const Finished done = run(with);
    unsetenv("SIDESTEP_INSTRUCTIONS");
    EXPECT_EQ(done.exit_code, 1) << done.error;
    said[static_cast<std::size_t>(threads - 1)] = done.out;
  }
  EXPECT_EQ(said[0], said[1]);
  EXPECT_THAT(said[0], HasSubstr("m4.csv: proven"));
  EXPECT_THAT(said[0], HasSubstr("m5.csv: refuted: at "));
  EXPECT_LT(said[0].find("m5.csv"), said[0].find("m10.csv"));
  const auto certificate = [&](const char* folder, const std::string& name) {
    std::ifstream in(folder_.path() / folder / name);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  EXPECT_EQ(certificate("proofs1", "m5.csv.json"), "");
  for (const std::string name : {"m0.csv.json", "m11.csv.json"}) {
    EXPECT_GT(certificate("proofs1", name).size(), 1000U);
    EXPECT_EQ(certificate("proofs1", name), certificate("proofs2", name));
    const std::string file = (folder_.path() / "proofs2" / name).string();
    EXPECT_EQ(std::system((std::string(RECHECK) + " " + file + " > /dev/null").c_str()), 0);
  }
  // A file that is wrong is named; the others have their verdicts.
  arguments[1] = folder_.write("m0.csv", header + "0,0,0\n").string();
  const Finished wrong = run(arguments);
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.error, HasSubstr("m0.csv:2: 3 fields where the header has 8"));
  EXPECT_THAT(wrong.out, HasSubstr("m11.csv: proven"));
}

TEST_F(CertifyCommand, NamesWhatIsWrong) {
  const Finished jumps = certify("0,0,0,0,-1,0,1,0\n0,1,0,0,-1,0,1,0\n");
  EXPECT_EQ(jumps.exit_code, 2);
  EXPECT_THAT(jumps.error, HasSubstr("motion.csv:3: time does not go on"));
  const Finished fast = certify("0,0,0,0,-1,0,1,0\n0.01,1,0,0,-1,0,1,0\n");
  EXPECT_EQ(fast.exit_code, 1);
  EXPECT_THAT(fast.out, HasSubstr("refuted: panda_joint1 breaks its velocity limit of 2.175 at"));
  const Finished json = certify("0,0,0,0,-1,0,1,0\n0,1,0,0,-1,0,1,0\n", {"--json"});
  EXPECT_THAT(Json::parse(json.out)["error"].get<std::string>(), HasSubstr("motion.csv:3"));
}

/// Whatever is asked for: no input is written over, and no earlier certificate stays.
TEST_F(CertifyCommand, LosesNothingAndLeavesNothingOld) {
  const std::string rows = "0,0,-0.785,0,-2.356,0,1.571,0.785\n2,-1,-0.3,0,-2,0,1.571,0.785\n";
  for (const char* input : {"motion.csv", "scene.yaml"}) {
    const Finished done = certify(rows, {"--out", (folder_.path() / input).string()});
    EXPECT_EQ(done.exit_code, 2);
    EXPECT_THAT(done.error, HasSubstr("is read, and --out would overwrite it"));
    EXPECT_GT(std::filesystem::file_size(folder_.path() / input), 50U);
  }
  EXPECT_EQ(certify(rows, {"--out", folder_.path().string()}).exit_code, 2);
  const std::string old = folder_.write("old.json", "{}").string();
  EXPECT_EQ(certify("0,0,nan,0,-1,0,1,0\n", {"--out", old}).exit_code, 2);
  EXPECT_FALSE(std::filesystem::exists(old));
}

}  // namespace
}  // namespace sidestep::testing
