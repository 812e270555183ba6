def page() -> str:
    return "# variables\n"
