#include <sidestep/plugin/plugin.hpp>

#include "simulator.hpp"

SIDESTEP_PLUGIN(sidestep::Source, sidestep::simulator::Options, sidestep::simulator::create_source,
                "simulator", "0.1.0",
                "A depth camera moving through a scene of known geometry, with a noise model")
