#pragma once

#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/observation_reader.h"

namespace knav {

/// The section `map_builder` of a configuration file. The local mapper's is the section `local_mapper`.
struct BuildMapConfig : MapBuilderConfig {
  ObservationReaderConfig recording;

  template <class Visitor>
  void visit(Visitor& v) {
    MapBuilderConfig::visit(v);
    v.group("recording", recording, "Topics and frames of the recording.");
  }
};

}  // namespace knav
