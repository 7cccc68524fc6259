#include "mapping_parts.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <sidestep/runtime/blocks.hpp>
#include <sidestep/runtime/entry_reading.hpp>

namespace sidestep {
namespace {

const std::vector<std::string> kSetOfMapper = {"resolution_m", "size_vox", "origin_m"};
const std::vector<std::string> kSetOfField = {"max_distance_m", "signed"};

Node number_node(double value, const SourceMark& mark) {
  return plain_scalar(detail::number_text(value), mark);
}

Node list_of(const Eigen::Vector3d& values, const SourceMark& mark) {
  Node::List items;
  for (const double value : values) items.push_back(number_node(value, mark));
  return Node(std::move(items), mark);
}

void put(Node& block, const std::string& key, Node value) {
  if (block.find(key) != nullptr) return;  // told of elsewhere
  block = with_entry(std::move(block), key, std::move(value));
}

/// What the experiment gives to every system's plugins, with where it says so.
struct Given {
  const Node& experiment;
  MappingBenchmarkSettings settings;

  [[nodiscard]] SourceMark mark(std::string_view key) const {
    const Node* value = experiment.find(key);
    return value != nullptr ? value->mark() : experiment.mark();
  }
};

Node mapper_block(const Given& given, const Node& written, std::size_t resolution) {
  const double resolution_m = given.settings.resolutions_m[resolution];
  const Eigen::Vector3d size_vox =
      (given.settings.extent_m.array() / resolution_m - 1e-6).ceil().max(1.0).matrix();
  Node block = written;
  const Node& written_as = given.experiment.find("resolutions_m")->items()[resolution];
  put(block, "resolution_m", number_node(resolution_m, written_as.mark()));
  put(block, "size_vox", list_of(size_vox, given.mark("extent_m")));
  put(block, "origin_m", list_of(given.settings.origin_m, given.mark("origin_m")));
  return block;
}

Node field_block(const Given& given, const Node& written, const PluginInfo& plugin,
                 std::optional<bool> is_signed, const SourceMark& signed_mark) {
  Node block = written;
  if (has_parameter(plugin.schema, "max_distance_m")) {
    put(block, "max_distance_m",
        number_node(given.settings.max_distance_m, given.mark("max_distance_m")));
  }
  if (is_signed && has_parameter(plugin.schema, "signed")) {
    put(block, "signed", plain_scalar(*is_signed ? "true" : "false", signed_mark));
  }
  return block;
}

/// What `signed` of a system asks for.
std::vector<std::optional<bool>> wanted_signs(const Node& node, std::vector<Error>& errors) {
  if (node.is_null()) return {std::nullopt};
  std::vector<std::optional<bool>> signs;
  const Node::List items = node.is_list() ? node.items() : Node::List{node};
  for (const Node& item : items) {
    if (const auto value = item.as_bool(); !value) {
      errors.push_back(value.error());
    } else if (std::ranges::find(signs, std::optional(*value)) != signs.end()) {
      errors.push_back(item.error("'signed' names " + item.text() + " twice"));
    } else {
      signs.emplace_back(*value);
    }
  }
  if (items.empty()) errors.push_back(node.error("'signed' is empty", "true, false, or both"));
  if (signs.empty()) signs.emplace_back();  // the rest of the system can still be checked
  return signs;
}

/// A key that the experiment sets must not stand in a plugin's block, too.
void refuse_set_keys(const Node& block, const std::vector<std::string>& keys,
                     std::vector<Error>& errors) {
  for (const Node::Entry& entry : block.entries()) {
    if (std::ranges::find(keys, entry.key) == keys.end()) continue;
    errors.push_back(Error{ErrorCode::kConfig,
                           "'" + entry.key + "' is set by the experiment, for every system alike",
                           entry.key_mark.to_string(),
                           "leave it out; the experiment has resolutions_m, extent_m, origin_m, "
                           "max_distance_m, and `signed` of a system",
                           nullptr});
  }
}

void check_resolutions(const Node& experiment, const MappingBenchmarkSettings& settings,
                       std::vector<Error>& errors) {
  const Node& list = *experiment.find("resolutions_m");
  if (list.items().empty()) errors.push_back(list.error("there is no resolution to measure at"));
  std::set<double> named;
  for (std::size_t i = 0; i < settings.resolutions_m.size(); ++i) {
    if (named.insert(settings.resolutions_m[i]).second) continue;
    const Node& item = list.items()[i];
    errors.push_back(item.error("'resolutions_m' names " + item.text() + " twice"));
  }
  if (!(settings.extent_m.array() > 0.0).all()) {
    const Node& extent = *experiment.find("extent_m");
    errors.push_back(extent.error("'extent_m' must be above 0 along each axis"));
  }
}

void check_published(const Node& experiment, const MappingBenchmarkSettings& settings,
                     std::vector<Error>& errors) {
  for (std::size_t i = 0; i < settings.published.size(); ++i) {
    const PublishedEntry& entry = settings.published[i];
    if (entry.frame_ms.size() == entry.resolutions_m.size()) continue;
    const Node& node = experiment.find("published")->items()[i];
    errors.push_back(node.error("'frame_ms' needs one figure for each of resolutions_m, " +
                                std::to_string(entry.resolutions_m.size()) + ", and has " +
                                std::to_string(entry.frame_ms.size())));
  }
}

/// Complains where `name` is none of `names`.
void check_name(const Node& node, const std::string& what, const std::set<std::string>& names,
                std::vector<Error>& errors) {
  if (names.contains(node.text())) return;
  const std::vector<std::string> list(names.begin(), names.end());
  const std::string known = list.empty() ? "none" : "'" + joined(list, "', '") + "'";
  errors.push_back(node.error("there is no " + what + " '" + node.text() + "'",
                              did_you_mean(node.text(), list, "there are: " + known)));
}

std::optional<double> published_ms(const MappingBenchmarkSettings& settings,
                                   const SystemEntry& system, std::optional<bool> is_signed,
                                   double resolution_m) {
  for (const PublishedEntry& entry : settings.published) {
    if (entry.name != system.published || (is_signed && *is_signed != entry.is_signed)) continue;
    for (std::size_t i = 0; i < std::min(entry.resolutions_m.size(), entry.frame_ms.size()); ++i) {
      if (std::abs(entry.resolutions_m[i] - resolution_m) < kSameResolution) {
        return entry.frame_ms[i];
      }
    }
  }
  return std::nullopt;
}

/// Appends the cases of one system.
void add_cases(const Given& given, const SystemEntry& system, Host& host,
               std::vector<SystemCase>& cases, std::vector<Error>& errors) {
  const auto mapper = host.find(PluginKind::kMapper, system.mapper);
  const auto field = host.find(PluginKind::kField, system.field);
  for (const auto* plugin : {&mapper, &field}) {
    if (!*plugin) errors.push_back(plugin->error());
  }
  const auto signs = wanted_signs(system.is_signed, errors);
  if (!mapper || !field) return;
  refuse_set_keys(system.mapper, kSetOfMapper, errors);
  refuse_set_keys(system.field, kSetOfField, errors);
  for (const std::string& key : kSetOfMapper) {
    if (has_parameter(mapper->schema, key)) continue;
    errors.push_back(system.mapper.error("the mapper '" + mapper->name + "' has no parameter '" +
                                         key + "', which the experiment must set"));
    return;
  }
  if (!system.is_signed.is_null() && !has_parameter(field->schema, "signed")) {
    errors.push_back(system.is_signed.error(
        "the field '" + field->name + "' has no parameter 'signed'", "leave `signed` out"));
  }
  host.check_views(system.mapper, field->views, "the field '" + field->name + "'", errors);
  std::set<std::string> told;  // a mistake in a block is the same at every resolution
  for (const auto is_signed : signs) {
    for (std::size_t r = 0; r < given.settings.resolutions_m.size(); ++r) {
      SystemCase one;
      one.name = system.name;
      one.mapper = mapper->name;
      one.field = field->name;
      one.is_signed = is_signed;
      one.resolution_m = given.settings.resolutions_m[r];
      one.published_ms = published_ms(given.settings, system, is_signed, one.resolution_m);
      one.mapper_block = mapper_block(given, system.mapper, r);
      one.field_block =
          field_block(given, system.field, *field, is_signed, system.is_signed.mark());
      const Node* unknown = one.field_block.find("unknown");
      one.unknown_occupied = unknown != nullptr && unknown->text() == "occupied";
      std::vector<Error> found;
      host.check(PluginKind::kMapper, one.mapper_block, found);
      host.check(PluginKind::kField, one.field_block, found);
      for (Error& error : found) {
        if (told.insert(error.describe()).second) errors.push_back(std::move(error));
      }
      cases.push_back(std::move(one));
    }
  }
}

}  // namespace

std::vector<SystemCase> read_cases(const Node& experiment, Host& host, std::vector<Error>& errors) {
  Given given{experiment, {}};
  if (!read_entry(experiment, given.settings, errors)) return {};
  check_resolutions(experiment, given.settings, errors);
  check_published(experiment, given.settings, errors);
  const Node& list = *experiment.find("systems");
  if (list.items().empty()) errors.push_back(list.error("there is no system to measure"));
  std::set<std::string> names, published;
  for (const PublishedEntry& entry : given.settings.published) published.insert(entry.name);
  std::vector<SystemCase> cases;
  for (std::size_t s = 0; s < given.settings.systems.size(); ++s) {
    const SystemEntry& system = given.settings.systems[s];
    const Node& node = list.items()[s];
    take_name(*node.find("name"), "a system", names, errors);
    if (const Node* name = node.find("published"); name != nullptr && !name->is_null()) {
      check_name(*name, "published system", published, errors);
    }
    add_cases(given, system, host, cases, errors);
  }
  if (const Node* reference = experiment.find("reference");
      reference != nullptr && !reference->is_null() && !reference->text().empty()) {
    check_name(*reference, "system", names, errors);
  }
  return cases;
}

Parameters<SystemEntry> SystemEntry::parameters() {
  using S = SystemEntry;
  return Parameters<S>()
      .add("name", &S::name, "Name of the system in results.", {.required = true})
      .add("mapper", &S::mapper,
           "A mapper's plugin and parameters, without resolution_m, size_vox and origin_m.",
           {.required = true, .plugin = PluginKind::kMapper, .set_by_owner = kSetOfMapper})
      .add("field", &S::field,
           "A field's plugin and parameters, without max_distance_m and signed.",
           {.required = true, .plugin = PluginKind::kField, .set_by_owner = kSetOfField})
      .add("signed", &S::is_signed, "true, false, or both in a list; left out: as the field is.")
      .add("published", &S::published, "Name of the entry of `published` to compare with.");
}

Parameters<PublishedEntry> PublishedEntry::parameters() {
  using P = PublishedEntry;
  return Parameters<P>()
      .add("name", &P::name, "What systems call it.", {.required = true})
      .add("signed", &P::is_signed, "Whether the figures are those of a signed field.",
           {.required = true})
      .add("resolutions_m", &P::resolutions_m, "Resolutions that there are figures for.",
           {.unit = "m", .min = 1e-4, .required = true})
      .add("frame_ms", &P::frame_ms, "The mean time of an update at each of them.",
           {.unit = "ms", .min = 0.0, .required = true});
}

Parameters<ExpectSettings> ExpectSettings::parameters() {
  using E = ExpectSettings;
  return Parameters<E>()
      .add("max_error_m", &E::max_error_m, "Largest error of a field.", {.unit = "m", .min = 0.0})
      .add("collision_recall", &E::collision_recall, "Least collision recall.",
           {.min = 0.0, .max = 1.0})
      .add("appear_frames", &E::appear_frames, "Most frames until a moving object appears.",
           {.min = 0.0})
      .add("gone_frames", &E::gone_frames,
           "Most frames until a voxel that an object has left is free, once it is seen through.",
           {.min = 0.0})
      .add("ghost_vox", &E::ghost_vox,
           "Most voxels, seen through, that are still occupied at the end.", {.min = 0.0});
}

Parameters<MappingBenchmarkSettings> MappingBenchmarkSettings::parameters() {
  using S = MappingBenchmarkSettings;
  return experiment_parameters<S>()
      .add("systems", &S::systems, "The systems to measure, in this order.", {.required = true})
      .add("resolutions_m", &S::resolutions_m, "Each system is measured at each of these.",
           {.unit = "m", .min = 1e-3, .max = 10.0, .required = true})
      .add("origin_m", &S::origin_m, "Lower corner of every map in the world.", {.unit = "m"})
      .add("extent_m", &S::extent_m, "Edges of every map.", {.unit = "m"})
      .add("max_distance_m", &S::max_distance_m, "Where every field cuts distances off.",
           {.unit = "m", .min = 0.01, .max = 10.0})
      .add("frames", &S::frames, "Frames to map; 0 for all that the source has.", {.min = 0})
      .add("stride", &S::stride, "Every n-th frame of the source is used.", {.min = 1})
      .add("frames_in_memory", &S::frames_in_memory,
           "Frames that are decoded ahead; if the sequence has more, each system reads it anew.",
           {.min = 1})
      .add("clock", &S::clock,
           "every_frame: as fast as possible; real_time: late frames are dropped; both.",
           {.choices = {"every_frame", "real_time", "both"}})
      .add("accuracy_every", &S::accuracy_every,
           "Fields are compared with the exact ones every n frames and at the end; 0: never.",
           {.unit = "frames", .min = 0})
      .add("reference", &S::reference, "The system that the others are compared with.")
      .add("published_as", &S::published_as, "Head of the column of published figures.")
      .add("published", &S::published, "Figures that somebody printed, to stand beside ours.")
      .add("truth", &S::truth, "How maps are held against the true scene.")
      .add("expect", &S::expect, "What every system must reach for the run to be a success.");
}

}  // namespace sidestep
