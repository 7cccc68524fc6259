#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <regex>
#include <string>
#include <vector>

#include <sidestep/core/file.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/runtime/install_layout.hpp>
#include <sidestep/runtime/library_version.hpp>

#include "commands.hpp"
#include "jobs.hpp"
#include "process_end.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;

/// A folder of examples, one a kind, and the CMakeLists.txt that all have.
fs::path template_folder() { return install_layout().configs.parent_path() / "template"; }

std::vector<std::string> kinds() {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(template_folder(), ignored)) {
    if (entry.is_directory()) names.push_back(entry.path().filename().string());
  }
  std::ranges::sort(names);
  return names;
}

/// "keep_side" is "KeepSide".
std::string camel_case(const std::string& name) {
  std::string text;
  bool begins = true;
  for (const char c : name) {
    if (c != '_') text += begins ? static_cast<char>(std::toupper(c)) : c;
    begins = c == '_';
  }
  return text;
}

/// Letters, digits and single underscores, as a namespace and a plugin's name can have them.
bool is_name(const std::string& name) {
  static const std::regex kWords("[a-z][a-z0-9]*(_[a-z0-9]+)*");
  static const std::regex kTaken(  // by C++, by the example itself, by CMake
      "alignas|alignof|and|and_eq|asm|auto|bitand|bitor|bool|break|case|catch|char|class|compl|"
      "concept|const|const_cast|consteval|constexpr|constinit|continue|co_await|co_return|co_yield|"
      "decltype|default|delete|do|double|dynamic_cast|else|enum|explicit|export|extern|false|float|"
      "for|friend|goto|if|inline|int|long|mutable|namespace|new|noexcept|not|not_eq|nullptr|"
      "operator|or|or_eq|private|protected|public|register|reinterpret_cast|requires|return|short|"
      "signed|sizeof|static|static_assert|static_cast|struct|switch|template|this|thread_local|"
      "throw|true|try|typedef|typeid|typename|union|unsigned|using|virtual|void|volatile|wchar_t|"
      "while|xor|xor_eq|std|sidestep|options|create|test|all|install|clean|help");
  return std::regex_match(name, kWords) && !std::regex_match(name, kTaken);
}

/// What stands in the example for what the new plugin has.
using Renaming = std::vector<std::pair<std::string, std::string>>;

std::string renamed(std::string text, const Renaming& renaming) {
  for (const auto& [from, to] : renaming) {
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
      text.replace(at, from.size(), to);
    }
  }
  return text;
}

/// The name of a kind's example: that of its one source that is no test.
Result<std::string> example_in(const fs::path& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string stem = entry.path().stem().string();
    if (entry.path().extension() == ".cpp" && !stem.ends_with("_test")) return stem;
  }
  return fail(ErrorCode::kNotFound, "the installation has no such example", folder.string());
}

Result<void> copy_renamed(const fs::path& from, const fs::path& folder, const Renaming& renaming) {
  const auto text = SIDESTEP_TRY(read_file(from));
  return write_file(folder / renamed(from.filename().string(), renaming), renamed(text, renaming));
}

Result<void> copy_example(const NewPluginOptions& options, const fs::path& folder) {
  const fs::path example = template_folder() / options.kind;
  const auto stem = SIDESTEP_TRY(example_in(example));
  const Renaming renaming = {{stem, options.name}, {camel_case(stem), camel_case(options.name)}};
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(example, error)) {
    SIDESTEP_TRY(copy_renamed(entry.path(), folder, renaming));
  }
  return copy_renamed(
      template_folder() / "CMakeLists.txt", folder,
      {{"@NAME@", options.name}, {"@KIND@", options.kind}, {"@VERSION@", library_version()}});
}

Result<void> write_plugin(const NewPluginOptions& options, const fs::path& folder) {
  const auto all = kinds();
  if (std::ranges::find(all, options.kind) == all.end()) {
    return fail(ErrorCode::kConfig, "there is no kind of plugin '" + options.kind + "'", "",
                did_you_mean(options.kind, all, "kinds: " + joined(all)));
  }
  if (!is_name(options.name)) {
    return fail(ErrorCode::kConfig, "'" + options.name + "' is no name of a plugin", "",
                "small letters, digits and single underscores, no word of C++, e.g. 'my_" +
                    options.kind + "'");
  }
  std::error_code error;
  if (fs::exists(folder, error)) {
    return fail(ErrorCode::kConfig, "exists already", folder.string(), "give another with --out");
  }
  fs::create_directories(folder, error);
  if (error) return fail(ErrorCode::kIo, "cannot be made: " + error.message(), folder.string());
  auto copied = copy_example(options, folder);
  if (!copied) fs::remove_all(folder, error);
  return copied;
}

/// What tells CMake where Sidestep is; nothing where it looks itself.
std::string prefix_option() {
  const fs::path library_folder = install_layout().plugins.parent_path().parent_path();
  const fs::path prefix = install_layout().configs.parent_path().parent_path().parent_path();
  std::error_code ignored;
  if (!fs::exists(library_folder / "cmake" / "Sidestep" / "SidestepConfig.cmake", ignored)) {
    return " -DCMAKE_PREFIX_PATH=<where Sidestep is installed>";
  }
  if (prefix == "/usr" || prefix == "/usr/local") return "";
  return " -DCMAKE_PREFIX_PATH=" + shell_word(prefix.string());
}

}  // namespace

ExitCode new_plugin_command(const NewPluginOptions& options) {
  const fs::path folder = options.out.value_or(options.name);
  if (const auto written = write_plugin(options, folder); !written) {
    print_errors({written.error()});
    return exit_code(written.error());
  }
  const std::string at = shell_word(folder.string());
  std::printf(
      "The %s plugin '%s' is in %s; its README.md says what helps you write one.\n"
      "To build it, and to test it:\n"
      "  cmake -S %s -B %s/build%s\n"
      "  cmake --build %s/build\n"
      "  ctest --test-dir %s/build --output-on-failure\n",
      options.kind.c_str(), options.name.c_str(), at.c_str(), at.c_str(), at.c_str(),
      prefix_option().c_str(), at.c_str(), at.c_str());
  return ExitCode::kSuccess;
}

ExitCode validate_command(const ValidateOptions& options) {
  const fs::path program = install_layout().plugins.parent_path() / "sidestep_validate";
  std::vector<std::string> words = {program.string(), std::to_string(options.timeout_s),
                                    options.library.string()};
  if (options.case_file) words.push_back(options.case_file->string());
  std::error_code ignored;
  if (!fs::exists(program, ignored)) {
    return wrong_input({ErrorCode::kConfig, "the suites are not installed", program.string(),
                        "build Sidestep where GoogleTest is (libgtest-dev)", nullptr});
  }
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const pid_t process = fork();
  if (process == 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    execv(arguments[0], arguments.data());
    _exit(static_cast<int>(ExitCode::kFault));
  }
  int status = 0;
  const bool has_ended = process > 0 && waitpid(process, &status, 0) == process;
  if (has_ended && WIFEXITED(status)) return static_cast<ExitCode>(WEXITSTATUS(status));
  print_errors({{ErrorCode::kInternal, has_ended ? manner_of_end(status) : "cannot begin",
                 program.string(), "", nullptr}});
  return ExitCode::kFault;
}

}  // namespace sidestep
