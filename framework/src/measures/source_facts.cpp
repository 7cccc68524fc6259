#include <sidestep/measures/source_facts.hpp>

namespace sidestep {

Result<std::shared_ptr<const Scene>> true_scene(const PluginPtr<Source>& source) {
  return call_plugin(plugin_of(source), [&]() -> Result<std::shared_ptr<const Scene>> {
    const auto* truth = dynamic_cast<const GroundTruth*>(source.get());
    return truth != nullptr ? std::make_shared<const Scene>(truth->scene()) : nullptr;
  });
}

Result<std::optional<std::int64_t>> frame_count_of(const PluginPtr<Source>& source) {
  return call_plugin(plugin_of(source), [&]() -> Result<std::optional<std::int64_t>> {
    return source->frame_count();
  });
}

}  // namespace sidestep
