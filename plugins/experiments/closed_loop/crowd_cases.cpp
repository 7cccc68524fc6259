#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <sidestep/core/format.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/geometry/people.hpp>
#include <sidestep/runtime/yaml_document.hpp>
#include "closed_loop.hpp"

namespace sidestep {
namespace {

constexpr double kCrossing_m = 10.0;

/// Of a `people` block that is not in any file.
Node block_of_text(const std::string& text, const std::filesystem::path& file) {
  std::vector<Error> errors;
  const auto node = parse_yaml(text, file, errors);
  return node ? *node : Node();
}

// What CrowdNav's cases have at a key; appends a mistake where they do not, and goes on with a
// value that does no harm.

const Node* needed_entry(const Node& map, const char* key, std::vector<Error>& errors) {
  const Node* found = map.find(key);
  if (found == nullptr) {
    errors.push_back(map.error("cases of CrowdNav have the key '" + std::string(key) + "' here"));
  }
  return found;
}

double positive_number(const Node& map, const char* key, std::vector<Error>& errors) {
  const Node* node = needed_entry(map, key, errors);
  if (node == nullptr) return 1.0;
  const auto value = node->as_double();
  if (value && *value > 0.0) return *value;
  errors.push_back(value ? node->error(std::string(key) + " must be greater than 0")
                         : value.error());
  return 1.0;
}

Eigen::Vector2d needed_place(const Node& map, const char* key, std::vector<Error>& errors) {
  const Node* node = needed_entry(map, key, errors);
  if (node == nullptr) return Eigen::Vector2d::Zero();
  const auto values = node->as_doubles(2);
  if (values) return {(*values)[0], (*values)[1]};
  errors.push_back(values.error());
  return Eigen::Vector2d::Zero();
}

/// Reads CrowdNav's cases.
std::vector<CrowdCase> read_cases(const Node& document, const std::filesystem::path& file,
                                  std::vector<Error>& errors) {
  std::vector<CrowdCase> cases;
  const Node* robot = needed_entry(document, "robot", errors);
  const Node* people = needed_entry(document, "people", errors);
  const Node* list = needed_entry(document, "cases", errors);
  const double step_s = positive_number(document, "time_step_s", errors);
  if (robot == nullptr || people == nullptr || list == nullptr || !list->is_list()) return cases;
  CrowdCase common;
  common.start_m = needed_place(*robot, "start", errors);
  common.goal_m = needed_place(*robot, "goal", errors);
  const std::string head = format("step_s: %.17g\nduration_s: %.17g\ngroups:\n", step_s,
                                  positive_number(document, "time_limit_s", errors));
  const std::string walk = format(", policy: orca, legs: false, radius_m: %.17g, speed_mps: %.17g",
                                  positive_number(*people, "radius_m", errors),
                                  positive_number(*people, "preferred_speed_mps", errors));
  for (const Node& one : list->items()) {
    const Node* walkers = needed_entry(one, "people", errors);
    if (walkers == nullptr) return {};
    std::string text = head;
    int count = 0;
    for (const Node& walker : walkers->items()) {
      const Eigen::Vector2d from_m = needed_place(walker, "start", errors);
      const Eigen::Vector2d to_m = needed_place(walker, "goal", errors);
      text += "  - {name: person_" + std::to_string(++count) + walk +
              format(", route_m: [[%.9g, %.9g], [%.9g, %.9g]]}\n", from_m.x(), from_m.y(), to_m.x(),
                     to_m.y());
    }
    if (count == 0) errors.push_back(walkers->error("a case has no people"));
    cases.push_back(common);
    cases.back().people = block_of_text(text, file);
  }
  if (cases.empty()) errors.push_back(list->error("there are no cases"));
  return cases;
}

/// Whose recording begins in the middle of the place walks in: nobody comes out of nowhere.
constexpr double kWalkIn_s = 10.0;

Node recorded_people(const std::filesystem::path& file, double duration_s, double from_s,
                     const std::string& more = {}) {
  return block_of_text(format("duration_s: %.17g\n", duration_s) +
                           "groups: [{name: person, policy: recorded, centred: true, file: '" +
                           std::filesystem::absolute(file).string() + "'" +
                           format(", from_s: %.17g", from_s) + more + "}]\n",
                       file);
}

}  // namespace

std::optional<CrowdCases> CrowdCases::read(const ReplanSettings& settings, const Node& experiment,
                                           std::vector<Error>& errors) {
  if (!settings.cases && !settings.people) return {};
  CrowdCases read;
  read.duration_s_ = settings.duration_s;
  if (settings.cases && settings.people) {
    errors.push_back(experiment.find("people")->error("'cases' and 'people' exclude each other"));
    return read;
  }
  if (settings.cases) {
    const auto document = YamlDocumentReader().read_leniently(*settings.cases, errors);
    if (!document) {
      errors.push_back(document.error());
      return read;
    }
    const std::size_t before = errors.size();
    read.cases_ = read_cases(*document, *settings.cases, errors);
    const std::int64_t wanted = std::int64_t{settings.first_episode} + settings.episodes;
    if (errors.size() == before && wanted > std::ssize(read.cases_)) {
      errors.push_back(experiment.error("there are " + std::to_string(read.cases_.size()) +
                                            " cases, and episodes up to number " +
                                            std::to_string(wanted - 1),
                                        "set experiment.episodes"));
    }
    return read;
  }
  read.recording_ = *settings.people;
  const People people = read_people(recorded_people(read.recording_, 1.0, 0.0), errors);
  read.first_s_ = std::numeric_limits<double>::infinity();
  for (const Person& person : people.persons) {
    read.first_s_ = std::min(read.first_s_, person.recorded.front().time_s);
    read.last_s_ = std::max(read.last_s_, person.recorded.back().time_s);
  }
  read.last_s_ = std::max(read.first_s_, read.last_s_ - read.duration_s_);
  return read;
}

CrowdCase CrowdCases::of(std::int64_t episode, std::uint64_t seed) const {
  if (recording_.empty()) return cases_[static_cast<std::size_t>(episode)];
  std::mt19937_64 generator(derive_seed(seed, "crossing"));
  const auto drawn = [&](double lower, double upper) {
    return std::uniform_real_distribution<double>(lower, upper)(generator);
  };
  const double from_s = drawn(first_s_, last_s_);
  const double angle_rad = drawn(-std::numbers::pi, std::numbers::pi);
  CrowdCase crossing;
  crossing.goal_m = 0.5 * kCrossing_m * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
  crossing.start_m = -crossing.goal_m;
  crossing.people =
      recorded_people(recording_, duration_s_, from_s, format(", walk_in_s: %.17g", kWalkIn_s));
  return crossing;
}

}  // namespace sidestep
