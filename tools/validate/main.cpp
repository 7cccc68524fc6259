// sidestep_validate SECONDS LIBRARY [CASE]: holds a built plugin to the suite of its kind, each
// test in a process of its own that has so many seconds. What `sidestep validate` starts.
#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/format.hpp>

#include "process_end.hpp"
#include "subject.hpp"

namespace sidestep::validate {
namespace {

enum ExitCode { kPassed = 0, kFailed = 1, kWrongCase = 2, kRefused = 3, kFault = 4 };

/// What came of a process.
struct Ended {
  std::string answer;   ///< What its work returned.
  std::string printed;  ///< On stdout and stderr.
  std::string fault;    ///< How it ended, where it did not come to its own end.
  double took_ms = 0.0;
};

std::string read_file(int file) {
  std::string text;
  std::array<char, 4096> part{};
  lseek(file, 0, SEEK_SET);
  for (ssize_t n = 0; (n = read(file, part.data(), part.size())) > 0;) {
    text.append(part.data(), static_cast<std::size_t>(n));
  }
  return text;
}

/// In the new process: says what the work returns, and then that it said all.
[[noreturn]] void work_and_tell(const std::function<std::string()>& work, int answer, int printed) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  dup2(printed, STDOUT_FILENO);
  dup2(printed, STDERR_FILENO);
  const std::string said = work();
  std::fflush(nullptr);
  if (write(answer, said.c_str(), said.size() + 1) < 0) std::abort();
  std::exit(kPassed);
}

/// Does work in a process of its own, for so long at most.
Ended in_process(double longest_s, const std::function<std::string()>& work) {
  Ended ended;
  std::string folder = (std::filesystem::temp_directory_path() / "sidestep-validate-XXXXXX");
  if (mkdtemp(folder.data()) == nullptr) return {.fault = "cannot begin"};
  std::array<int, 2> answer{};
  std::FILE* const printed = std::tmpfile();
  if (printed == nullptr || pipe2(answer.data(), O_CLOEXEC) != 0) return {.fault = "cannot begin"};
  const Stopwatch watch;
  const Deadline deadline = Deadline::after_s(longest_s);
  const pid_t process = fork();
  if (process == 0) {
    setenv("TMPDIR", folder.c_str(), 1);
    work_and_tell(work, answer[1], fileno(printed));
  }
  close(answer[1]);
  // Until the process has ended, which closes the pipe.
  bool is_open = process > 0;
  while (is_open && !deadline.expired()) {
    pollfd watched{answer[0], POLLIN, 0};
    std::array<char, 4096> part{};
    if (poll(&watched, 1, 100) <= 0) continue;
    const ssize_t count = read(answer[0], part.data(), part.size());
    if (count > 0) ended.answer.append(part.data(), static_cast<std::size_t>(count));
    is_open = count > 0;
  }
  close(answer[0]);
  if (is_open) kill(process, SIGKILL);
  std::error_code ignored;
  int status = 0;
  if (process <= 0 || waitpid(process, &status, 0) != process) return {.fault = "cannot begin"};
  ended.took_ms = watch.elapsed_ms();
  std::filesystem::remove_all(folder, ignored);
  ended.printed = read_file(fileno(printed));
  std::fclose(printed);
  const bool said_all = ended.answer.ends_with('\0');
  if (is_open) {
    ended.fault = "hangs: no end after " + format("%g", longest_s) + " s";
  } else if (!said_all || !WIFEXITED(status)) {
    ended.fault = manner_of_end(status) + (said_all ? " after its tests" : "");
  }
  if (said_all) ended.answer.pop_back();
  return ended;
}

/// Opens the subject, and has GoogleTest know its tests, or `filter` of them.
Result<void> prepare(const std::filesystem::path& library, const std::filesystem::path& file,
                     const std::string& filter) {
  subject() = SIDESTEP_TRY(Subject::open(library, file));
  std::string program = "sidestep_validate", wanted = "--gtest_filter=" + filter;
  std::array<char*, 3> words = {program.data(), wanted.data(), nullptr};
  int count = 2;
  testing::InitGoogleTest(&count, words.data());
  return {};
}

/// The answer of a process that looks at the plugin for the first time: an exit code, and then what
/// it is or what is wrong, and its tests, a line each.
std::string look(const std::filesystem::path& library, const std::filesystem::path& file) {
  try {
    if (const auto prepared = prepare(library, file, "*"); !prepared) {
      const bool refused = prepared.error().code == ErrorCode::kPlugin;
      return std::to_string(refused ? kRefused : kWrongCase) + "\n" + prepared.error().describe();
    }
  } catch (const std::exception& error) {  // made for the first time
    return std::to_string(kFailed) + "\nerror: " + error.what();
  }
  const PluginInfo& info = subject()->info();
  std::string text = std::to_string(kPassed) + "\n" + std::string(to_string(info.kind)) +
                     " plugin '" + info.name + "', version " + info.version;
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  for (int s = 0; s < all.total_test_suite_count(); ++s) {
    const testing::TestSuite& suite = *all.GetTestSuite(s);
    // GoogleTest's own, of suites that are not this kind's.
    if (std::string_view(suite.name()) == "GoogleTestVerification") continue;
    for (int t = 0; t < suite.total_test_count(); ++t) {
      text += std::string("\n") + suite.name() + "." + suite.GetTestInfo(t)->name();
    }
  }
  return text;
}

/// The answer of a process that runs one test.
std::string run_test(const std::filesystem::path& library, const std::filesystem::path& file,
                     const std::string& test) {
  if (const auto prepared = prepare(library, file, test); !prepared) {
    std::printf("%s\n", prepared.error().describe().c_str());
    return "FAILED";
  }
  if (RUN_ALL_TESTS() != 0) return "FAILED";
  return testing::UnitTest::GetInstance()->skipped_test_count() > 0 ? "skipped" : "ok";
}

/// "plugin/FieldConformance.IsExact/0" is "FieldConformance.IsExact".
std::string short_name(std::string name) {
  if (name.starts_with("plugin/")) name.erase(0, 7);
  return name.substr(0, name.find('/'));
}

/// GoogleTest's own account of one test, without its frame, indented.
std::string account_of(const std::string& printed) {
  std::istringstream lines(printed);
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    const bool is_frame = line.starts_with("[") || line.starts_with("Note: ") ||
                          line.starts_with("Running main()") || line.find("FAILED TEST") == 1;
    if (!is_frame && !line.empty()) text += "            " + line + "\n";
  }
  return text;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

int validate(double longest_s, const std::filesystem::path& library,
             const std::filesystem::path& file) {
  const Ended first = in_process(longest_s, [&] { return look(library, file); });
  if (!first.fault.empty()) {
    std::fprintf(stderr, "%s%s: %s as it was opened\n", first.printed.c_str(), library.c_str(),
                 first.fault.c_str());
    return kRefused;
  }
  std::vector<std::string> lines = lines_of(first.answer);
  if (const int code = std::stoi(lines.at(0)); code != kPassed) {
    std::fputs(first.printed.c_str(), stderr);
    for (std::size_t i = 1; i < lines.size(); ++i) std::fprintf(stderr, "%s\n", lines[i].c_str());
    return code;
  }
  const std::string plugin = lines.at(1);
  std::printf("%s\n%s\n", plugin.c_str(), library.c_str());
  std::fflush(stdout);
  lines.erase(lines.begin(), lines.begin() + 2);
  std::size_t failed = 0, skipped = 0;
  for (const std::string& test : lines) {
    const Ended ended = in_process(longest_s, [&] { return run_test(library, file, test); });
    const bool passed = ended.fault.empty() && ended.answer != "FAILED";
    if (!passed) ++failed;
    if (ended.answer == "skipped") ++skipped;
    const std::string how = ended.fault.empty() ? "" : ": " + ended.fault;
    std::printf("  %-7s %s%s (%.0f ms)\n", ended.fault.empty() ? ended.answer.c_str() : "ENDED",
                short_name(test).c_str(), how.c_str(), ended.took_ms);
    if (!passed) std::fputs(account_of(ended.printed).c_str(), stdout);
    std::fflush(stdout);
  }
  const std::string left_out =
      skipped > 0 ? ", " + std::to_string(skipped) + " of them skipped" : "";
  if (failed == 0) {
    std::printf("Passed: all %zu tests of the %s%s.\n", lines.size(), plugin.c_str(),
                left_out.c_str());
  } else {
    std::printf("Failed: %zu of %zu tests of the %s%s.\n", failed, lines.size(), plugin.c_str(),
                left_out.c_str());
  }
  return failed == 0 ? kPassed : kFailed;
}

}  // namespace
}  // namespace sidestep::validate

int main(int argc, char** argv) {
  const double longest_s = argc > 1 ? std::strtod(argv[1], nullptr) : 0.0;
  if ((argc != 3 && argc != 4) || !(longest_s > 0.0)) {
    std::fprintf(stderr, "usage: sidestep_validate SECONDS LIBRARY [CASE]\n");
    return sidestep::validate::kWrongCase;
  }
  std::error_code error;
  const auto library = std::filesystem::absolute(argv[2], error);
  if (!std::filesystem::is_regular_file(library, error)) {
    std::fprintf(stderr, "%s: there is no such library\n", argv[2]);
    return sidestep::validate::kWrongCase;
  }
  return sidestep::validate::validate(longest_s, library, argc == 4 ? argv[3] : "");
}
