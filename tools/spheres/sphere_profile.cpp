#include "sphere_profile.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <tuple>

#include <sidestep/core/format.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "load_robot.hpp"
#include "profile.hpp"
#include "spheres_text.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;

constexpr double kMostMetres = 100.0;

Result<std::string> read_text(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  if (!in.is_open() || in.bad()) return fail(ErrorCode::kIo, "cannot be read", file.string());
  return text;
}

Result<std::shared_ptr<const KinematicTree>> load(const fs::path& file,
                                                  const HostContext& context) {
  urdf_robot::Options options;
  options.profile = Node(Node::Scalar{file.string(), true}, {"command line"});
  auto robot = SIDESTEP_TRY(urdf_robot::load_robot(options, context));
  return std::shared_ptr<const KinematicTree>(std::move(robot));
}

Result<void> check_spheres(const std::vector<CollisionSphere>& spheres,
                           const RobotDescription& robot) {
  const auto wrong = [&](const CollisionSphere& one) {
    return one.link < 0 || one.link >= static_cast<int>(robot.links.size()) ||
           !one.centre_link_m.allFinite() ||
           one.centre_link_m.cwiseAbs().maxCoeff() > kMostMetres ||
           !(one.radius_m >= 1e-6 && one.radius_m <= kMostMetres);
  };
  if (spheres.empty()) return invalid("a robot needs a sphere at least");
  if (std::ranges::any_of(spheres, wrong)) {
    return invalid("a sphere lies on no link, or its centre or radius is out of bounds");
  }
  return {};
}

auto key(const CollisionSphere& one) {
  return std::tuple(one.link, one.centre_link_m.x(), one.centre_link_m.y(), one.centre_link_m.z(),
                    one.radius_m);
}

bool are_same(std::vector<CollisionSphere> a, std::vector<CollisionSphere> b) {
  std::ranges::sort(a, {}, key);
  std::ranges::sort(b, {}, key);
  return std::ranges::equal(a, b, {}, key, key);
}

/// All that a profile says, but its spheres and, where it moved, its paths.
std::string all_else(const Node& document, bool has_moved) {
  Node rest = document;
  std::erase_if(rest.entries(), [&](const Node::Entry& entry) {
    const bool is_path = entry.key == "urdf" || entry.key == "package_paths";
    return entry.key == "spheres" || (has_moved && is_path);
  });
  return to_yaml(rest, false);
}

tl::unexpected<Error> not_writable(const fs::path& file, int error) {
  return fail(ErrorCode::kIo, std::string("cannot be written: ") + std::strerror(error),
              file.string(), "copy the profile's folder to a place of your own, or use --out FILE");
}

/// A new file beside another one, which is removed unless it has taken its place.
class FreshFile {
 public:
  explicit FreshFile(fs::path place) : place_(std::move(place)) {
    file_ = place_.parent_path() /
            ("." + place_.filename().string() + "." + std::to_string(getpid()) + ".new");
  }
  ~FreshFile() {
    if (!is_placed_) unlink(file_.c_str());
  }
  FreshFile(const FreshFile&) = delete;
  FreshFile& operator=(const FreshFile&) = delete;

  [[nodiscard]] const fs::path& file() const noexcept { return file_; }

  [[nodiscard]] Result<void> write(const std::string& text, mode_t mode) const {
    unlink(file_.c_str());
    const int out = open(file_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
    if (out < 0) return not_writable(place_, errno);
    std::size_t done = 0;
    int error = fchmod(out, mode) == 0 ? 0 : errno;
    while (error == 0 && done < text.size()) {
      const ssize_t count = ::write(out, text.data() + done, text.size() - done);
      if (count > 0) done += static_cast<std::size_t>(count);
      if (count < 0 && errno != EINTR) error = errno;
    }
    if (error == 0 && fsync(out) != 0) error = errno;
    if (close(out) != 0 && error == 0) error = errno;
    if (error != 0) return not_writable(place_, error);
    return {};
  }

  [[nodiscard]] Result<void> take_place() {
    if (rename(file_.c_str(), place_.c_str()) != 0) return not_writable(place_, errno);
    is_placed_ = true;
    return {};
  }

 private:
  fs::path place_;
  fs::path file_;
  bool is_placed_ = false;
};

}  // namespace

Result<SphereProfile> SphereProfile::open(const std::string& name,
                                          const std::optional<fs::path>& out,
                                          const HostContext& context) {
  const Node node(Node::Scalar{name, true}, {"command line"});
  const auto found = SIDESTEP_TRY(urdf_robot::find_profile(node, context.robot_paths));
  std::error_code error;
  fs::path source = fs::canonical(found, error);
  if (error) return fail(ErrorCode::kIo, error.message(), found.string());
  fs::path target = source;
  if (out) {
    target = fs::absolute(*out, error).lexically_normal();
    if (fs::exists(fs::symlink_status(target, error))) {
      return fail(ErrorCode::kIo, "there is such a file already", out->string(), "name a new one");
    }
  }
  SphereProfile profile(std::move(source), std::move(target), context);
  SIDESTEP_TRY(profile.read());
  return profile;
}

Result<void> SphereProfile::read() {
  auto text = SIDESTEP_TRY(read_text(source_));
  auto robot = SIDESTEP_TRY(load(source_, *context_));
  text_ = std::move(text);
  robot_ = std::move(robot);
  return {};
}

std::string SphereProfile::revision() const {
  std::uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  for (const char c : text_) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return format("%016llx", static_cast<unsigned long long>(hash));
}

Result<void> SphereProfile::check_writable() const {
  if (access(target_.parent_path().c_str(), W_OK | X_OK) != 0) return not_writable(target_, errno);
  struct stat state {};
  if (stat(target_.c_str(), &state) != 0) return {};
  // For root, too, a file that nobody may write is not meant to be written.
  const bool is_protected = (state.st_mode & (S_IWUSR | S_IWGRP | S_IWOTH)) == 0;
  if (is_protected || access(target_.c_str(), W_OK) != 0) return not_writable(target_, EACCES);
  return {};
}

Result<std::string> SphereProfile::text_with(const std::vector<CollisionSphere>& spheres) const {
  std::vector<Error> errors;
  const auto document = SIDESTEP_TRY(parse_yaml(text_, source_.string(), errors));
  std::string text = with_spheres(text_, document, robot_->description().links, spheres);
  const fs::path folder = target_.parent_path();
  if (folder == source_.parent_path()) return text;
  // Elsewhere, relative paths lead elsewhere. Positions are the new text's.
  const auto moved = SIDESTEP_TRY(parse_yaml(text, source_.string(), errors));
  std::vector<const Node*> paths;
  if (const Node* const packages = moved.find("package_paths")) {
    for (const Node& item : packages->items()) paths.push_back(&item);
  }
  if (const Node* const urdf = moved.find("urdf")) paths.push_back(urdf);
  std::ranges::sort(paths, std::ranges::greater{}, [](const Node* node) {
    return std::pair(node->mark().line, node->mark().column);
  });
  for (const Node* const node : paths) {
    const fs::path path = (source_.parent_path() / node->text()).lexically_normal();
    text = with_path(text, *node, path.lexically_proximate(folder).string());
  }
  return text;
}

Result<void> SphereProfile::save(const std::vector<CollisionSphere>& spheres) {
  SIDESTEP_TRY(check_spheres(spheres, robot_->description()));
  SIDESTEP_TRY(check_writable());
  const auto now = SIDESTEP_TRY(read_text(source_));
  if (now != text_) {
    return fail(ErrorCode::kIo, "the profile was changed meanwhile by somebody else",
                source_.string(), "load it again");
  }
  const auto text = SIDESTEP_TRY(text_with(spheres));
  return replace_target(text, spheres);
}

Result<void> SphereProfile::replace_target(const std::string& text,
                                           const std::vector<CollisionSphere>& spheres) {
  struct stat state {};
  const mode_t mode = stat(source_.c_str(), &state) == 0 ? state.st_mode & 0777 : 0644;
  FreshFile fresh(target_);
  SIDESTEP_TRY(fresh.write(text, mode | S_IWUSR));
  // Nothing takes the profile's place that does not say what it should.
  auto robot = SIDESTEP_TRY(load(fresh.file(), *context_));
  std::vector<Error> errors;
  const auto before = parse_yaml(text_, source_.string(), errors);
  const auto after = parse_yaml(text, target_.string(), errors);
  const bool has_moved = target_.parent_path() != source_.parent_path();
  const bool is_right = before && after && are_same(robot->description().spheres, spheres) &&
                        all_else(*before, has_moved) == all_else(*after, has_moved);
  if (!is_right) {
    return fail(ErrorCode::kConfig, "the spheres cannot be written into this profile's text",
                source_.string(), "list one sphere a line under 'spheres'");
  }
  SIDESTEP_TRY(fresh.take_place());
  source_ = target_;
  text_ = text;
  robot_ = std::move(robot);
  return {};
}

}  // namespace sidestep
