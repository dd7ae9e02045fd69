"""``python -m cutvib_ss.validation.rig``: see `cutvib_ss.validation.rig.bulk`."""

from cutvib_ss.validation.rig.bulk import main

if __name__ == "__main__":
    main()
