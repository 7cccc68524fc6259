#include <sidestep/geometry/load_scene.hpp>

#include <algorithm>
#include <utility>

namespace sidestep {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> candidates(const fs::path& scene, const std::vector<fs::path>& folders) {
  std::vector<fs::path> files = {scene, fs::path(scene).concat(".yaml")};
  for (const fs::path& folder : folders) {
    files.push_back(folder / scene.filename());
    files.push_back((folder / scene.filename()).concat(".yaml"));
  }
  return files;
}

std::vector<std::string> names_in(const std::vector<fs::path>& folders) {
  std::vector<std::string> names;
  for (const fs::path& folder : folders) {
    std::error_code error;
    for (auto file = fs::directory_iterator(folder, error);
         !error && file != fs::directory_iterator(); file.increment(error)) {
      if (file->path().extension() == ".yaml") names.push_back(file->path().stem().string());
    }
  }
  std::ranges::sort(names);
  return names;
}

Error not_found(const fs::path& scene, const std::vector<fs::path>& folders) {
  Error error{ErrorCode::kNotFound, "there is no scene '" + scene.string() + "'", {}, {}, nullptr};
  const std::vector<std::string> names = names_in(folders);
  error.hint = did_you_mean(
      scene.stem().string(), names,
      names.empty() ? "a scene is a YAML file, given by its path" : "there are: " + joined(names));
  return error;
}

/// `error` with `rest` as the cause of its last cause.
std::shared_ptr<const Error> followed_by(const Error& error, std::shared_ptr<const Error> rest) {
  Error copy = error;
  copy.cause = error.cause ? followed_by(*error.cause, std::move(rest)) : std::move(rest);
  return std::make_shared<const Error>(std::move(copy));
}

/// As many mistakes as somebody reads; of the others their number is told.
constexpr std::size_t kMostTold = 100;

Error chained(const std::vector<Error>& errors, const fs::path& file) {
  const std::size_t told = std::min(errors.size(), kMostTold);
  std::shared_ptr<const Error> rest;
  for (std::size_t i = told; i > 0; --i) rest = followed_by(errors[i - 1], std::move(rest));
  std::string what = "the scene has " + std::to_string(errors.size()) +
                     (errors.size() == 1 ? " mistake" : " mistakes");
  if (told < errors.size()) what += ", of which these are the first " + std::to_string(told);
  return Error{ErrorCode::kConfig, std::move(what), file.string(), {}, rest};
}

}  // namespace

Result<Scene> load_scene(const fs::path& scene, const std::vector<fs::path>& folders,
                         const DocumentReader& documents) {
  for (const fs::path& file : candidates(scene, folders)) {
    std::error_code ignored;
    if (!fs::is_regular_file(file, ignored)) continue;
    std::vector<Error> errors;
    const auto document = SIDESTEP_TRY(documents.read_leniently(file, errors));
    SceneReading reading = read_scene(document);
    errors.insert(errors.end(), reading.errors.begin(), reading.errors.end());
    if (!errors.empty()) return tl::make_unexpected(chained(errors, file));
    return std::move(reading.scene);
  }
  return tl::make_unexpected(not_found(scene, folders));
}

}  // namespace sidestep
