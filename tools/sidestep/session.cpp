#include "session.hpp"

#include <algorithm>
#include <cstdio>

namespace sidestep {

namespace fs = std::filesystem;

ExitCode exit_code(const Error& error) noexcept {
  switch (error.code) {
    case ErrorCode::kConfig: return ExitCode::kConfiguration;
    case ErrorCode::kPlugin: return ExitCode::kPlugin;
    default: return ExitCode::kFault;
  }
}

ExitCode exit_code(const std::vector<Error>& errors) noexcept {
  const bool only_plugins =
      std::ranges::all_of(errors, [](const Error& e) { return e.code == ErrorCode::kPlugin; });
  return only_plugins ? ExitCode::kPlugin : ExitCode::kConfiguration;
}

ExitCode worse(ExitCode a, ExitCode b) noexcept { return std::max(a, b); }

void print_errors(const std::vector<Error>& errors) {
  for (const Error& error : errors) std::fprintf(stderr, "%s\n", error.describe().c_str());
}

Result<fs::path> find_configuration(const std::string& name) {
  std::error_code ignored;
  if (fs::is_regular_file(name, ignored)) return fs::path(name);
  const fs::path folder = install_layout().configs;
  for (const fs::path& candidate : {folder / name, folder / (name + ".yaml")}) {
    if (fs::is_regular_file(candidate, ignored)) return candidate;
  }
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
  const std::string nearest = nearest_name(fs::path(name).stem().string(), names);
  std::string hint = "neither a file nor a configuration in " + folder.string();
  if (!nearest.empty()) hint += "; did you mean '" + nearest + "'?";
  return fail(ErrorCode::kNotFound, "there is no such configuration", name, hint);
}

CheckedConfiguration load_configuration(const std::string& name,
                                        const std::vector<std::string>& overrides, Log& log) {
  CheckedConfiguration loaded;
  const auto file = find_configuration(name);
  if (!file) {
    loaded.errors.push_back(file.error());
    return loaded;
  }
  auto reading = read_configuration(*file, overrides, YamlDocumentReader());
  loaded.configuration = std::move(reading.configuration);
  loaded.errors = std::move(reading.errors);
  if (loaded.configuration.root.entries().empty()) return loaded;  // told why already
  loaded.settings = read_run_settings(loaded.configuration);
  loaded.session = std::make_unique<Session>(loaded.settings, &log);
  for (Error& error : check_configuration(loaded.configuration, loaded.session->host())) {
    loaded.errors.push_back(std::move(error));
  }
  return loaded;
}

}  // namespace sidestep
