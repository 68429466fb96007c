"""What the commands of the diagnosis share: options, mistakes, the model that is named."""
